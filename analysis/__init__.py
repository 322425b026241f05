"""Arrays in, values out: contact models, fits, moduli with uncertainty."""

from analysis.campaign import Campaign, Quantity, Sensor, Shot, Sphere, Surface
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.result import FitResult

__all__ = [
    "Campaign",
    "FitResult",
    "Quantity",
    "Sensor",
    "Shot",
    "Sphere",
    "Surface",
    "fit_campaign",
]
