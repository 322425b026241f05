"""A stored calibration: the cell it describes, and how far it lies from another one."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np

from analysis.campaign import Sensor
from analysis.errors import AnalysisError
from analysis.fit.measurand import as_quantity

FORMAT = "impactd-calibration/1"
Json = dict[str, Any]

IDENTIFIABLE = {
    "sensor.gain_N_per_V": "gain_N_per_V",
    "sensor.natural_frequency_Hz": "natural_frequency_Hz",
    "sensor.damping_ratio": "damping_ratio",
}
"""Names in a fit's parameters and in a calibration's JSON."""
DRIFT_LIMIT = 2.0
"""Drift in combined standard uncertainties from which it is called one."""


class Documented(Protocol):
    """Anything that can state itself as JSON."""

    def to_json(self) -> Json:
        """Return the document."""
        ...


def sensor_from_json(calibration: Json) -> Sensor:
    """Return the cell that a stored calibration describes.

    Parameters
    ----------
    calibration : dict
        ``impactd-calibration/1``, as `CalibrationResult.to_json` made it.

    Returns
    -------
    Sensor
        With the covariance of ln(M, k, mu, c).

    Raises
    ------
    AnalysisError
        If this is no such document, or the calibration did not converge.
    """
    if calibration.get("format") != FORMAT:
        raise AnalysisError(
            f"This is no calibration: its format is {calibration.get('format')!r}, not {FORMAT!r}."
        )
    outcome = calibration["outcome"]
    if outcome["status"] != "converged":
        raise AnalysisError(f"This calibration cannot be used: {outcome['message']}")
    values = {name: as_quantity(q) for name, q in calibration["parameters"].items() if q}
    covariance = calibration["covariance"]
    hsd = calibration["hsd"]
    return Sensor(
        compliance_m_per_v=values.get("compliance_m_per_v"),
        crystal_mass_kg=values.get("crystal_mass_kg"),
        crystal_stiffness_n_per_m=values.get("crystal_stiffness_n_per_m"),
        crystal_damping_n_s_per_m=values.get("crystal_damping_n_s_per_m"),
        hsd_n_per_v=as_quantity(hsd["gain_N_per_V"]) if hsd else None,
        covariance=np.array(covariance["matrix"]) if covariance else None,
    )


def drift(previous: Json | Documented, current: Json | Documented) -> Json:
    """Return how far the cell moved between two calibrations.

    Parameters
    ----------
    previous, current : dict or CalibrationResult
        Two calibrations of one cell.

    Returns
    -------
    dict
        Per identifiable combination the relative ``change``, its standard uncertainty ``u`` and
        ``in_u``, change over u; ``largest_in_u``; and one ``sentence``.

    Notes
    -----
    Both calibrations share the reference materials' uncertainty, which would cancel; it is kept, so
    the scores are on the careful side.
    """
    before, after = (x if isinstance(x, dict) else x.to_json() for x in (previous, current))
    found: Json = {}
    for label in IDENTIFIABLE.values():
        a, b = before["identifiable"].get(label), after["identifiable"].get(label)
        if not a or not b:
            continue
        change = math.log(b["value"] / a["value"])
        u = math.hypot(a["u"] / a["value"], b["u"] / b["value"])
        found[label] = {"change": math.expm1(change), "u": u, "in_u": change / u if u > 0 else 0.0}
    if not found:
        return {"combinations": {}, "largest_in_u": None, "sentence": "Nothing to compare."}
    worst = max(found, key=lambda name: abs(found[name]["in_u"]))
    size = abs(found[worst]["in_u"])
    verdict = "drifted" if size > DRIFT_LIMIT else "is stable"
    return {
        "combinations": found,
        "largest_in_u": size,
        "sentence": (
            f"The cell {verdict}: {worst} changed by {found[worst]['change']:+.2%}, "
            f"{size:.1f} combined standard uncertainties."
        ),
    }
