"""``impactd shots``: the list, and one shot."""

from __future__ import annotations

from typing import Any

from analysis.written_numbers import measured
from impactd.advice import in_words
from impactd.console.client import connect
from impactd.console.tables import LIGHTS, paint, print_json, table


def list_shots(filters: dict[str, Any], *, limit: int, url: str | None, as_json: bool) -> None:
    """Print stored shots, newest first."""
    with connect(url) as client:
        found = list(client.pages("/v1/shots", limit, **filters))
    if as_json:
        print_json(found)
        return
    if not found:
        chosen = ", ".join(f"{key} {value}" for key, value in filters.items() if value is not None)
        print(f"No stored shot has {chosen}." if chosen else "There are no shots yet.")
        return
    headings = ("shot", "when (UTC)", "sphere", "surface", "height/m", "peak", "operator", "note")
    print(table(headings, [_row(shot) for shot in found]))


def _row(shot: dict[str, Any]) -> tuple[Any, ...]:
    return (
        shot["number"],
        shot["started_utc"][:19].replace("T", " "),
        shot["sphere"],
        shot["surface"],
        shot["drop_height_m"],
        float(f"{shot['peak']:.3g}"),
        shot["operator"],
        "clipped" if shot["clipped"] else "",
    )


def show(number: int, *, url: str | None, as_json: bool) -> None:
    """Print one shot with its fits."""
    with connect(url) as client:
        shot = client.get(f"/v1/shots/{number}")
    if as_json:
        print_json(shot)
        return
    told = {**shot, "peak": f"{shot['peak']:.4g}", "clipped": "yes" if shot["clipped"] else "no"}
    for name in (
        "number",
        "started_utc",
        "sphere",
        "surface",
        "drop_height_m",
        "operator",
        "sample_rate_hz",
        "samples",
        "peak",
        "clipped",
        "sha256",
    ):
        print(f"{name:15} {told[name]}")
    fits = shot["fits"] or []
    if fits:
        print("\nNot to be used:" if shot["advice"] == "repeat" else "")
        print(
            table(
                ("fit", "model", "E* +- U (95 %)/GPa", "R2", "mind that"),
                [_fit_row(fit) for fit in fits],
            )
        )
    if shot["advice"]:
        print(f"\n{advice_words(shot)}")


def advice_words(shot: dict[str, Any]) -> str:
    """Return what to do with a shot, and each reason in the daemon's words on a line of its own."""
    word = paint(shot["advice"], LIGHTS.get(shot["advice"], "white"))
    because = [f"  - {reason}" for reason in shot["because"] or []]
    return "\n".join([f"Advice: {word}, because", *because] if because else [f"Advice: {word}"])


def _fit_row(fit: dict[str, Any]) -> tuple[Any, ...]:
    result = fit["result"]
    return (
        fit["id"],
        fit["model"],
        measured(result.get("reduced_modulus_Pa"), scale=1e-9),
        result.get("r2"),
        " ".join(one[0].upper() + one[1:] for one in map(in_words, result.get("flags") or [])),
    )
