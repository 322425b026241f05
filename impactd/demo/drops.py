"""Calibration and campaign of the demo, over HTTP, shown as they happen."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

from rich.console import Console

from analysis.base_models import DEFAULT_BASE
from analysis.written_numbers import measured
from impactd.aliases import Json
from impactd.client.connection import Connection
from impactd.client.talk import DROP_ENDED, drop_has_ended, fresh_key
from impactd.console.failure import Failure

SPHERES = ("acetal", "acetal_small", "hdpe")
"""Two radii of one material, and a softer one."""
SURFACES = ("specimen", "polycarbonate")
REFERENCE_SURFACES = ("aluminium",)
"""What the calibration drops on."""
DROP_HEIGHTS_M = (0.020, 0.045, 0.070)
REPEATS = 2


MOST_SHOTS = 500
NEARLY, LOWERED = 0.99, 0.6
"""Share of the range from which a clipped shot hit the converter; what its height is lowered to."""
_POLL_S = 0.03
_DROP_LIMIT_S = 60.0
_FIT_LIMIT_S = 600.0


def plan() -> list[tuple[str, str, float]]:
    """Return the campaign: every sphere on every surface from every height, then all of it again.

    Several heights and radii are what tells effects apart that look alike in one drop, and a second
    round at a later hour is what tells a drift from a property of a surface.

    Returns
    -------
    list of tuple
        Sphere, surface, drop height [m].
    """
    return [
        (sphere, surface, height_m)
        for _ in range(REPEATS)
        for surface in SURFACES
        for sphere in SPHERES
        for height_m in DROP_HEIGHTS_M
    ]


def calibrate(client: Connection, console: Console) -> Json:
    """Run a calibration of the load cell and show its drops.

    Parameters
    ----------
    client : Connection
        Connected to the daemon.

    Returns
    -------
    dict
        The calibration as the API gives it, ``done`` or ``failed``. A failed one ends nothing: a
        hidden effect may have spoiled it, and the certificate's values are still there.

    Raises
    ------
    Failure
        If it does not end.
    """
    body = {"slot": None, "plan": None, "unattended": False}
    number = client.send("POST", "/v1/calibrations", body, key=fresh_key())["number"]
    shown: set[int] = set()
    with console.status("calibrating the load cell ..."):
        for run in until(client, f"/v1/calibrations/{number}", ("done", "failed"), _FIT_LIMIT_S):
            for drop_number in run["drops"]:
                drop = client.get(f"/v1/drops/{drop_number}")
                if drop_number not in shown and drop["shot"]:
                    shown.add(drop_number)
                    shot = client.get(f"/v1/shots/{drop['shot']}")
                    console.print(_line(shot), highlight=False)
    if run["state"] == "failed":
        problem = run["problem"] or {"detail": "no reason is given"}
        console.print(f"  It failed: {problem['detail']}", highlight=False)
        console.print("  Continuing with the values of the load cell's certificate.")
    return run


def drop_all(client: Connection, console: Console, *, range_v: float) -> list[Json]:
    """Drop the whole campaign; a drop beyond the converter's range is repeated from lower down.

    Parameters
    ----------
    client : Connection
        Connected to the daemon.
    range_v : float
        Largest voltage of the converter. [V]

    Returns
    -------
    list of dict
        The shots with their fits, as the API gives them.

    Raises
    ------
    Failure
        If a drop ends without a shot.
    """
    shots: list[Json] = []
    waiting: deque[tuple[int, float]] = deque()
    lowered: dict[tuple[str, str, float], float] = {}
    for sphere, surface, height_m in plan():
        while True:
            wanted_m = lowered.get((sphere, surface, height_m), height_m)
            asked_s = time.monotonic()
            drop = _drop(client, console, sphere, surface, wanted_m)
            waiting.append((drop["number"], asked_s))
            # the next sphere falls while this shot is fitted
            shots += _analysed(client, console, waiting, left=1)
            if not overloaded(client.get(f"/v1/shots/{drop['shot']}"), range_v):
                break
            lowered[sphere, surface, height_m] = LOWERED * wanted_m
            console.print(f"           above {range_v:g} V: repeated from a lower height")
    return [*shots, *_analysed(client, console, waiting, left=0)]


def overloaded(shot: Json, range_v: float) -> bool:
    """Return whether a shot went beyond the converter's range.

    An amplifier that clips below it is another matter: that is a property of the rig, which a
    diagnosis may find.

    Parameters
    ----------
    range_v : float
        Largest voltage of the converter. [V]

    Returns
    -------
    bool
        Such a shot belongs into no campaign.
    """
    return bool(shot["clipped"]) and abs(shot["peak"]) > NEARLY * range_v


def _drop(client: Connection, console: Console, sphere: str, surface: str, height_m: float) -> Json:
    """Make one drop, and return it once its shot is stored."""
    body = {"sphere": sphere, "surface": surface, "drop_height_m": height_m, "operator": "demo"}
    number = client.send("POST", "/v1/drops", body, key=fresh_key())["number"]
    what = f"{sphere} on {surface} from {height_m * 1e3:g} mm"
    with console.status(f"{what} ...") as status:
        for drop in until(client, f"/v1/drops/{number}", ("stored", *DROP_ENDED), _DROP_LIMIT_S):
            status.update(f"{what}: {drop['state']}")
    if not drop["shot"]:
        problem = drop["problem"] or {"detail": f"it is {drop['state']}", "remedy": ""}
        raise Failure(f"drop {number} failed: {problem['detail']} {problem['remedy']}".strip())
    return drop


def _analysed(
    client: Connection, console: Console, waiting: deque[tuple[int, float]], *, left: int
) -> list[Json]:
    """Show shots in the order of their drops once they are analysed, and return them.

    ``waiting`` has drops by number and when they were asked for [s]; as many as ``left`` may stay.
    """
    shots = []
    ends_s = time.monotonic() + _DROP_LIMIT_S
    while waiting:
        number, asked_s = waiting[0]
        drop = client.get(f"/v1/drops/{number}")
        if drop_has_ended(drop):
            waiting.popleft()
            shots.append(client.get(f"/v1/shots/{drop['shot']}"))
            console.print(_line(shots[-1], waited_s=time.monotonic() - asked_s), highlight=False)
        elif len(waiting) <= left:
            break
        elif time.monotonic() > ends_s:
            raise Failure(f"drop {number} was still {drop['state']} after {_DROP_LIMIT_S:g} s.")
        else:
            time.sleep(_POLL_S)
    return shots


def fit_together(client: Connection, numbers: list[int], model: str, console: Console) -> Json:
    """Have the daemon fit drops as a whole.

    Parameters
    ----------
    client : Connection
        Connected to the daemon.
    model : str
        ``hsd`` or ``kv``.

    Returns
    -------
    dict
        ``impactd-fit/1``.

    Raises
    ------
    Failure
        If the fit failed.
    """
    body = {"shots": numbers, "model": model}
    job = client.send("POST", "/v1/fits", body, key=fresh_key())
    with console.status(f"fitting {len(numbers)} drops together with {model.upper()} ..."):
        for answer in until(client, f"/v1/fits/{job['id']}", ("done", "failed"), _FIT_LIMIT_S):
            job = answer
    if job["state"] == "failed" or not job["fits"]:
        raise Failure(f"the joint {model.upper()} fit failed: {job['reason']}")
    result: Json = job["fits"][0]["result"]
    return result


def until(client: Connection, path: str, ended: tuple[str, ...], limit_s: float) -> Iterator[Json]:
    """Yield a resource again and again until its state is one of the last ones.

    Parameters
    ----------
    client : Connection
        Connected to the daemon.
    limit_s : float
        Longest wait. [s]

    Yields
    ------
    dict
        The resource; at last in one of those states.

    Raises
    ------
    Failure
        If it takes longer.
    """
    deadline = time.monotonic() + limit_s
    while True:
        answer = client.get(path)
        yield answer
        if answer["state"] in ended:
            return
        if time.monotonic() > deadline:
            raise Failure(f"{path} was still {answer['state']} after {limit_s:g} s.")
        time.sleep(_POLL_S)


def _line(shot: Json, *, waited_s: float | None = None) -> str:
    """Return what a technician wants to read of a shot."""
    what = f"{shot['sphere']} on {shot['surface']}"
    parts = [
        f"  shot {shot['number']:>2}  {what:<31}{shot['drop_height_m'] * 1e3:5.1f} mm",
        f"peak {shot['peak']:6.3f} V",
    ]
    parts += [
        f"E* {measured(fit['result'].get('reduced_modulus_Pa'), scale=1e-9, sign='±')} GPa"
        for fit in shot["fits"] or []
        if fit["model"] == DEFAULT_BASE
    ]
    if waited_s is not None:
        parts.append(f"{waited_s:.1f} s")
        parts.append(str(shot["advice"] or "not analysed"))
    return "  ".join(parts)
