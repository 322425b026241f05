"""A stored calibration, and the cell it describes."""

from __future__ import annotations

import numpy as np

from analysis.aliases import Json
from analysis.campaign import Sensor
from analysis.errors import AnalysisError
from analysis.fit.measurand import as_quantity

FORMAT = "impactd-calibration/1"

IDENTIFIABLE = {
    "sensor.gain_N_per_V": "gain_N_per_V",
    "sensor.natural_frequency_Hz": "natural_frequency_Hz",
    "sensor.damping_ratio": "damping_ratio",
}
"""Names in a fit's parameters and in a calibration's JSON."""


def sensor_from_json(calibration: Json) -> Sensor:
    """Return the cell that a stored calibration describes.

    Parameters
    ----------
    calibration : dict
        ``impactd-calibration/1``, as `CalibrationResult.to_json` made it.

    Returns
    -------
    Sensor
        With the covariance of ln(M, k, mu, c), and how they follow what they were made with.

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
        # calibrations of earlier versions took every stated number as exact
        inputs={key: tuple(one) for key, one in (calibration.get("inputs") or {}).items()},
        hsd_inputs={key: one[0] for key, one in ((hsd or {}).get("inputs") or {}).items()},
    )
