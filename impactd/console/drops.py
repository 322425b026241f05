"""``impactd drop``: ask, watch, tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

from analysis.written_numbers import measured
from impactd.client.connection import Connection
from impactd.client.talk import compared_shot, fresh_key, watch_drop
from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.progress_bar import progress, tell
from impactd.console.shots import advice_words
from impactd.console.tables import print_json


def environment_members(
    given: Mapping[str, tuple[str, float | None, float | None]],
) -> dict[str, Any]:
    """Return what a drop's body says of temperature and humidity, nothing where nothing is said.

    Parameters
    ----------
    given : mapping
        Per key of the body: the option, its value and its standard uncertainty.

    Raises
    ------
    typer.BadParameter
        If one of a value and its uncertainty is missing.
    """
    found = {}
    for key, (option, value, u) in given.items():
        if value is not None and u is None:
            raise typer.BadParameter(
                f"{option} {value:g} needs its standard uncertainty: add {option}-u"
            )
        if value is None and u is not None:
            raise typer.BadParameter(f"{option}-u {u:g} belongs to {option}, which is missing")
        if value is not None:
            found[key] = {"value": value, "u": u}
    return {"environment": found} if found else {}


def run(
    body: dict[str, Any],
    *,
    proposed_by: int | None = None,
    key: str | None,
    wait: bool,
    url: str | None,
    as_json: bool,
) -> None:
    """Ask for a drop and print what became of it.

    Parameters
    ----------
    body : dict
        Of ``POST /v1/drops``, or of a diagnosis's ``next-drop``.
    proposed_by : int, optional
        The diagnosis whose proposed drop is made.
    key : str or None
        Idempotency key; ``None`` takes a fresh one.
    wait : bool
        Whether to wait for the modulus.
    as_json : bool
        Print the answer, and the shot's with it.

    Raises
    ------
    Failure
        If the drop did not end with a stored shot.
    """
    with connect(url) as client:
        to = "/v1/drops"
        if proposed_by is not None:
            to = f"/v1/diagnoses/{proposed_by}/next-drop"
        drop = client.send("POST", to, body, key=key or fresh_key())
        number = drop["number"]
        if wait:
            drop = _watch(client, number)
        shot = None
        if drop["shot"]:
            at = drop["shot"]
            shot = client.run(compared_shot(at)) if wait else client.get(f"/v1/shots/{at}")
    if as_json:
        print_json({**drop, "result": shot})
    elif not wait:
        print(f"Drop {number} is {drop['state']}.")
    elif shot:
        print(_told(drop, shot))
    if wait and not drop["shot"]:
        problem = drop["problem"] or {"detail": f"It is {drop['state']}.", "remedy": ""}
        raise Failure(f"drop {number}: {problem['detail']} {problem['remedy']}".strip())


def hang_words(sphere: str, surface: str, drop_height_m: float) -> str:
    """Return what somebody is asked to hang where."""
    return f"hang the {sphere} sphere {drop_height_m * 1e3:.1f} mm above the {surface} coupon"


def _watch(client: Connection, number: int) -> dict[str, Any]:
    asked = False

    def follow(text: str, share: float | None) -> None:
        """Say once which sphere to hang, when the rig waits for it."""
        nonlocal asked
        if text.endswith("requested") and not asked:
            rig = client.get("/v1/status")
            if rig["drop"] == number and rig["state"] == "LOADING":
                asked = True
                drop = client.get(f"/v1/drops/{number}")
                words = hang_words(drop["sphere"], drop["surface"], drop["drop_height_m"])
                tell(f"Drop {number}: {words}; the valve opens once the sphere is held.")
        progress(text, share=share)

    try:
        return client.run(watch_drop(number, follow))
    except KeyboardInterrupt:
        raise Failure(
            f"drop {number} continues without this command; `impactd abort` ends it."
        ) from None
    finally:
        progress("", last=True)


def _told(drop: dict[str, Any], shot: dict[str, Any]) -> str:
    lines = [
        f"Shot {shot['number']}: {shot['sphere']} on {shot['surface']} from "
        f"{shot['drop_height_m']:g} m, peak {shot['peak']:.3g} V."
    ]
    if shot["advice"] == "repeat":
        lines.append(
            f"  No modulus: the shot must not be used. Its fits: impactd shots {shot['number']}"
        )
    else:
        for fit in shot["fits"] or []:
            modulus = measured(fit["result"].get("reduced_modulus_Pa"), scale=1e-9)
            lines.append(f"  {fit['model']}: reduced modulus {modulus} GPa (95 %)")
    if drop["problem"]:
        lines.append(f"Not analysed: {drop['problem']['detail']}")
    if shot["advice"]:
        lines.append(advice_words(shot))
    return "\n".join(lines)
