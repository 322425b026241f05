"""Arrays in, values out: contact models, fits, moduli with uncertainty."""

from analysis.bounce import bounce_indices, restitution_from_bounce
from analysis.calibration import CalibrationResult, calibrate, drift, sensor_from_json
from analysis.campaign import Campaign, Quantity, Rejected, Sensor, Shot, Sphere, Surface
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
    "calibrate",
    "drift",
    "fit_campaign",
    "observation_from_fit",
    "observations_from_fit",
    "restitution_from_bounce",
    "sensor_from_json",
]
