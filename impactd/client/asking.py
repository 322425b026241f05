"""From a program's arguments to the API's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from impactd.aliases import Json
from impactd.client import talk
from impactd.client.environment import login_name
from impactd.client.errors import RigError
from impactd.client.talk import Talk, Tell

Reading = tuple[float, float]
"""A value and its standard uncertainty."""
_TALL_M = 2.0
"""Nobody hangs a sphere so high above a load cell; millimetres were meant."""


def drop_body(
    what: tuple[str, str, float],
    operator: str | None,
    *,
    temperature_C: Reading | None = None,
    relative_humidity: Reading | None = None,
) -> Json:
    """Return the body of a drop.

    Parameters
    ----------
    what : tuple
        Sphere, surface and drop height [m].
    operator : str or None
        Who hangs the sphere; ``None`` is the login name.
    temperature_C, relative_humidity : tuple of float, optional
        As somebody read them. [degC, 1]

    Returns
    -------
    dict
        Of ``POST /v1/drops``.

    Raises
    ------
    RigError
        If the height can only be meant in another unit.
    """
    sphere, surface, height_m = what
    if height_m >= _TALL_M:
        raise RigError(f"a drop height is in metres; for {height_m:g} mm write {height_m:g} * mm.")
    body: Json = {
        "sphere": sphere,
        "surface": surface,
        "drop_height_m": float(height_m),
        "operator": operator or login_name(),
    }
    readings = {"temperature_C": temperature_C, "relative_humidity": relative_humidity}
    known = {
        name: {"value": float(reading[0]), "u": float(reading[1])}
        for name, reading in readings.items()
        if reading is not None
    }
    return body | ({"environment": known} if known else {})


def drop(body: Json, key: str, tell: Tell) -> Talk[Json]:
    """Request a drop and return its shot, analysed and compared with its repetitions."""
    begun = yield from talk.send("POST", "/v1/drops", body, key=key)
    return (yield from talk.shot_of_drop(begun["number"], tell))


def begin_calibration(plan: Sequence[Json] | None, slot: str | None, key: str) -> Talk[Json]:
    """Ask for a calibration run."""
    body = {"plan": None if plan is None else list(plan), "slot": slot, "unattended": False}
    return (yield from talk.send("POST", "/v1/calibrations", body, key=key))


def fit(shots: Sequence[int], model: str, key: str, tell: Tell) -> Talk[Json]:
    """Ask for a fit and return it once it is done."""
    body = {"shots": list(shots), "model": model}
    job = yield from talk.send("POST", "/v1/fits", body, key=key)
    return (yield from talk.job_result(f"/v1/fits/{job['id']}", f"fit {job['id']}", tell))


def diagnose(
    shots: Sequence[int], base: str, budget_s: float | None, key: str, tell: Tell
) -> Talk[Json]:
    """Ask for a diagnosis and return it once it is done."""
    body: dict[str, Any] = {"shots": list(shots), "base": base, "budget_s": budget_s}
    job = yield from talk.send("POST", "/v1/diagnoses", body, key=key)
    at = f"/v1/diagnoses/{job['id']}"
    return (yield from talk.job_result(at, f"diagnosis {job['id']}", tell))
