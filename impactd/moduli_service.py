"""Moduli over the archive: the stored fit of every shot goes into one network of materials.

No trace is read and nothing is fitted here; the answer follows the archive at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis import PairObservation, adjust_moduli, observation_from_fit, sensor_from_json
from impactd.materials import Materials
from impactd.storage.archive import Archive, Calibration, Fit, NotFoundError, Shot
from impactd.storage.moment import utc_now
from impactd.storage.version import software

FORMAT = "impactd-moduli/1"
CERTIFICATE = "certificate"
"""What the cell's values came from before the first calibration."""
RIGID_CELL_MODEL = "hsd"

Json = dict[str, Any]


@dataclass(frozen=True)
class _Use:
    """A stored fit and what the network makes of it."""

    fit: Fit
    shot: Shot
    observation: PairObservation | None
    why_not: str | None


def moduli(
    archive: Archive,
    materials: Materials,
    *,
    specimen: str | None = None,
    since: str | None = None,
    until: str | None = None,
    model: str = "kv",
) -> Json:
    """Return what all stored fits together say about each material.

    Parameters
    ----------
    archive : Archive
        Fits and calibrations.
    materials : Materials
        Spheres and surfaces with what is known of them.
    specimen : str, optional
        Only report this surface and its pairs. All shots still take part: a sphere that was dropped
        on a reference tells about the specimen too.
    since, until : str, optional
        First moment of a shot that counts and first that does not, in the archive's form.
    model : str
        Model of the fits.

    Returns
    -------
    dict
        ``impactd-moduli/1`` with, beside the network's result, ``calibration`` (which, its date,
        until when it is valid, whether it is overdue), ``shots`` (numbers and SHA-256 of the files)
        and ``excluded``. Every modulus carries ``calibration_overdue``. Without any usable fit
        ``moduli`` is empty and ``warnings`` says so.

    Raises
    ------
    AnalysisError
        If a shot names a material that is unknown today.
    """
    uses = [
        _use(archive, fit) for fit in archive.fits.latest(model=model, since=since, until=until)
    ]
    observations = [use.observation for use in uses if use.observation is not None]
    current = archive.calibrations.current()
    found = _adjusted(archive, materials, observations, model)
    if specimen is not None:
        found = _only(found, specimen)
    state = _calibration_state(current)
    for entry in found["moduli"].values():
        entry["calibration_overdue"] = state["overdue"]
    if state["sentence"]:
        found["warnings"] = [*found["warnings"], state["sentence"]]
    return {
        **found,
        "specimen": specimen,
        "since": since,
        "until": until,
        "calibration": state,
        "shots": [
            {"number": use.shot.number, "sha256": use.shot.sha256}
            for use in uses
            if use.why_not is None
        ],
        "excluded": [
            {"shot": use.shot.number, "reason": use.why_not}
            for use in uses
            if use.why_not is not None
        ],
        "software": software(),
    }


def _use(archive: Archive, fit: Fit) -> _Use:
    assert fit.shot is not None  # `latest` gives fits of single shots only
    shot = archive.shot(fit.shot)
    why_not = _why_not(archive, fit, shot)
    if why_not is not None:
        return _Use(fit, shot, None, why_not)
    calibration = CERTIFICATE if fit.calibration is None else str(fit.calibration)
    seen = observation_from_fit(fit.result, shot=f"shot {shot.number}", calibration=calibration)
    return _Use(fit, shot, seen, None if seen else "its fit gives no reduced modulus")


def _why_not(archive: Archive, fit: Fit, shot: Shot) -> str | None:
    """Return why a shot stays out of the network, ``None`` when it takes part."""
    if shot.source == "import":
        return "it was recorded elsewhere; fit its campaign instead"
    outcome = fit.result["outcome"]
    if outcome["status"] != "converged":
        return str(outcome["message"])
    if shot.clipped:
        return "it sits on a limit of the converter or amplifier"
    try:
        drop = archive.drop(shot.number)
    except NotFoundError:
        return None
    if drop.calibration is not None:
        # The cell's calibration rests on it already; counted again, it would vouch for itself.
        return f"it belongs to calibration {drop.calibration}"
    return None


def _adjusted(
    archive: Archive, materials: Materials, observations: list[PairObservation], model: str
) -> Json:
    if not observations:
        return {
            "format": FORMAT,
            "model": model,
            "moduli": {},
            "pairs": {},
            "network": None,
            "covariance": None,
            "calibrations": [],
            "warnings": [f"No stored shot has a usable {model} fit for this choice."],
        }
    covariances: dict[str, NDArray[np.float64]] = {}
    for name in {one.calibration for one in observations}:
        covariance = _cell_covariance(archive, name, model)
        if covariance is not None:
            covariances[name] = covariance
    result = adjust_moduli(observations, materials.spheres, materials.surfaces, covariances)
    return result.to_json()


def _cell_covariance(archive: Archive, name: str, model: str) -> NDArray[np.float64] | None:
    """Return the covariance that the fits' sensitivities refer to, ``None`` to use their own u."""
    if name == CERTIFICATE:
        return None
    calibration = archive.calibrations.get(int(name))
    if calibration.result is None:
        return None
    sensor = sensor_from_json(calibration.result)
    if model.partition("+")[0] != RIGID_CELL_MODEL:
        return sensor.covariance
    gain = sensor.hsd_n_per_v
    return None if gain is None else np.array([[(gain.u / gain.value) ** 2]])


def _only(found: Json, specimen: str) -> Json:
    pairs = {key: one for key, one in found["pairs"].items() if one["surface"] == specimen}
    kept = {
        key: one
        for key, one in found["moduli"].items()
        if key in (specimen, f"surface:{specimen}") and one["side"] == "surface"
    }
    warnings = list(found["warnings"])
    if not kept:
        warnings.append(f"No usable shot was dropped on {specimen!r}.")
    return {**found, "moduli": kept, "pairs": pairs, "warnings": warnings}


def _calibration_state(current: Calibration | None) -> Json:
    if current is None or current.valid_until_utc is None:
        return {
            "number": None,
            "finished_utc": None,
            "valid_until_utc": None,
            "overdue": True,
            "sentence": "The load cell has not been calibrated; its certificate was used.",
        }
    overdue = current.valid_until_utc <= utc_now()
    sentence = f"The calibration is overdue since {current.valid_until_utc}." if overdue else ""
    return {
        "number": current.number,
        "finished_utc": current.finished_utc,
        "valid_until_utc": current.valid_until_utc,
        "overdue": overdue,
        "sentence": sentence,
    }
