"""Arrays in, values out: contact models, fits, moduli with uncertainty.

Names are imported on first use: whoever needs a `Quantity` must not wait for the compiler behind
the fits.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.bounce import bounce_indices, restitution_from_bounce
    from analysis.bounce_shots import bounce_shots, with_bounces
    from analysis.calibration import CalibrationResult, calibrate, sensor_from_json
    from analysis.campaign import Campaign, Quantity, Rejected, Sensor, Shot, Sphere, Surface
    from analysis.cell_drift import drift
    from analysis.errors import AnalysisError
    from analysis.fit.campaign_fit import fit_campaign
    from analysis.fit.result import FitResult
    from analysis.moduli import (
        PairObservation,
        adjust_moduli,
        observation_from_fit,
        observations_from_fit,
    )
    from analysis.moduli_result import ModuliResult

_HOME = {
    "AnalysisError": "analysis.errors",
    "CalibrationResult": "analysis.calibration",
    "Campaign": "analysis.campaign",
    "FitResult": "analysis.fit.result",
    "ModuliResult": "analysis.moduli_result",
    "PairObservation": "analysis.moduli",
    "Quantity": "analysis.campaign",
    "Rejected": "analysis.campaign",
    "Sensor": "analysis.campaign",
    "Shot": "analysis.campaign",
    "Sphere": "analysis.campaign",
    "Surface": "analysis.campaign",
    "adjust_moduli": "analysis.moduli",
    "bounce_indices": "analysis.bounce",
    "bounce_shots": "analysis.bounce_shots",
    "calibrate": "analysis.calibration",
    "drift": "analysis.cell_drift",
    "fit_campaign": "analysis.fit.campaign_fit",
    "observation_from_fit": "analysis.moduli",
    "observations_from_fit": "analysis.moduli",
    "restitution_from_bounce": "analysis.bounce",
    "sensor_from_json": "analysis.calibration",
    "with_bounces": "analysis.bounce_shots",
}

__all__ = [
    "AnalysisError",
    "CalibrationResult",
    "Campaign",
    "FitResult",
    "ModuliResult",
    "PairObservation",
    "Quantity",
    "Rejected",
    "Sensor",
    "Shot",
    "Sphere",
    "Surface",
    "adjust_moduli",
    "bounce_indices",
    "bounce_shots",
    "calibrate",
    "drift",
    "fit_campaign",
    "observation_from_fit",
    "observations_from_fit",
    "restitution_from_bounce",
    "sensor_from_json",
    "with_bounces",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'analysis' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value
