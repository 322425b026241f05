"""The sizes that a campaign's columns are measured in."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """Sizes common to a campaign, so that a column means the same in every shot.

    Attributes
    ----------
    top : float
        Largest signal of all shots. [unit of the signal]
    indentation_m : float
        Median largest indentation. [m]
    speed_m_per_s : float
        Median impact speed. [m/s]
    pulse_s : float
        Median width of the pulses. [s]
    contact_s : float
        Median contact time by Hertz. [s]
    window_s : float
        Longest window. [s]
    tuned_hz : dict
        Frequency by family, of those that were looked for along the residual. [Hz]
    tuned_zeta : float
        Damping ratio of the one whose damping was looked for as well. [1]
    ripples : float
        Periods of a curve's ripple between zero and the top. [1]
    steepest_per_s : float
        Largest slope of the records. [unit of the signal/s]
    late_impact_us : float
        Width of a late impact after the impact. [us]
    """

    top: float
    indentation_m: float
    speed_m_per_s: float
    pulse_s: float
    contact_s: float
    window_s: float
    tuned_hz: dict[str, float] = field(default_factory=dict)
    tuned_zeta: float = 0.0
    ripples: float = 0.0
    steepest_per_s: float = 0.0
    late_impact_us: float = 0.0
