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
    from analysis.campaign_readers import load_campaign
    from analysis.cell_drift import drift
    from analysis.diagnosing import diagnose
    from analysis.diagnosis.progress import TimeBudget, each_step
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
    from analysis.plots.calibration_history import plot_calibrations
    from analysis.plots.confusion import plot_confusion
    from analysis.plots.moduli import literature_of, plot_moduli
    from analysis.plots.paper_figures import plot_traces
    from analysis.plots.residuals import plot_diagnosis, plot_residuals
    from analysis.plots.shot import plot_shot

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
    "TimeBudget": "analysis.diagnosis.progress",
    "adjust_moduli": "analysis.moduli",
    "bounce_indices": "analysis.bounce",
    "bounce_shots": "analysis.bounce_shots",
    "calibrate": "analysis.calibration",
    "diagnose": "analysis.diagnosing",
    "drift": "analysis.cell_drift",
    "each_step": "analysis.diagnosis.progress",
    "fit_campaign": "analysis.fit.campaign_fit",
    "literature_of": "analysis.plots.moduli",
    "load_campaign": "analysis.campaign_readers",
    "observation_from_fit": "analysis.moduli",
    "observations_from_fit": "analysis.moduli",
    "plot_calibrations": "analysis.plots.calibration_history",
    "plot_confusion": "analysis.plots.confusion",
    "plot_diagnosis": "analysis.plots.residuals",
    "plot_moduli": "analysis.plots.moduli",
    "plot_residuals": "analysis.plots.residuals",
    "plot_shot": "analysis.plots.shot",
    "plot_traces": "analysis.plots.paper_figures",
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
    "TimeBudget",
    "adjust_moduli",
    "bounce_indices",
    "bounce_shots",
    "calibrate",
    "diagnose",
    "drift",
    "each_step",
    "fit_campaign",
    "literature_of",
    "load_campaign",
    "observation_from_fit",
    "observations_from_fit",
    "plot_calibrations",
    "plot_confusion",
    "plot_diagnosis",
    "plot_moduli",
    "plot_residuals",
    "plot_shot",
    "plot_traces",
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
