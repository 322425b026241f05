"""Which samples of a record a fit uses, and what the record says before any model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Shot
from analysis.errors import ShotRejectedError
from analysis.noise import NoiseModel, estimate_noise, noise_from_differences

PRE_PULSES = 4.0
POST_PULSES = 12.0
"""The window reaches so many pulse widths before and after the pulse."""
MIN_PRE_S = 0.4e-3
MIN_POST_S = 2.5e-3
"""And at least so far, so that the crystal has rung out."""
MAX_SAMPLES = 6000

_EDGE = 0.05


@dataclass(frozen=True)
class Window:
    """The part of a shot that is fitted.

    Attributes
    ----------
    first : int
        Index of the window's first sample in the record.
    signal : ndarray, shape (n,)
        The samples. [unit of the signal]
    peak_index : int
        Largest sample, counted within the window.
    rise_index : int
        Where the pulse first exceeds 5 % of its peak, within the window.
    width_s : float
        Time above 5 % of the peak. [s]
    baseline : float
        Median before the pulse. [unit of the signal]
    peak : float
        Largest excursion over the baseline. [unit of the signal]
    """

    first: int
    signal: NDArray[np.float64]
    peak_index: int
    rise_index: int
    width_s: float
    baseline: float
    peak: float


def _first_pulse(shot: Shot) -> tuple[int, int, int, float, float]:
    """Return (rise, peak, fall, baseline, height) of the pulse nearest after the trigger."""
    x = shot.signal
    search = max(64, int(5e-3 * shot.sample_rate_hz))
    low = max(0, shot.trigger_index - search // 4)
    high = min(x.size, shot.trigger_index + search)
    quiet = x[max(0, low - 2000) : max(1, shot.trigger_index - 8)]
    baseline = float(np.median(quiet)) if quiet.size >= 8 else float(np.median(x))
    peak = low + int(np.argmax(x[low:high]))
    height = float(x[peak]) - baseline
    if not height > 0:
        raise ShotRejectedError(
            f"{shot.name}: nothing rises above the baseline within {search} samples of the "
            f"trigger; the trigger index {shot.trigger_index} may be wrong or the polarity inverted."
        )
    limit = baseline + _EDGE * height
    rise = peak
    while rise > 0 and x[rise - 1] > limit:
        rise -= 1
    fall = peak
    while fall + 1 < x.size and x[fall + 1] > limit:
        fall += 1
    return rise, peak, fall, baseline, height


def cut(shot: Shot) -> Window:
    """Return the window of one shot.

    Parameters
    ----------
    shot : Shot
        The recording.

    Returns
    -------
    Window
        From well before the pulse until the crystal has rung out, before the next bounce.

    Raises
    ------
    ShotRejectedError
        If no pulse rises above the baseline near the trigger.
    """
    rise, peak, fall, baseline, height = _first_pulse(shot)
    rate = shot.sample_rate_hz
    width = (fall - rise + 1) / rate
    before = math.ceil(max(MIN_PRE_S, PRE_PULSES * width) * rate)
    after = math.ceil(max(MIN_POST_S, POST_PULSES * width) * rate)
    first = max(0, rise - min(before, MAX_SAMPLES // 4))
    last = min(shot.signal.size, peak + min(after, 3 * MAX_SAMPLES // 4))
    return Window(
        first=first,
        signal=np.ascontiguousarray(shot.signal[first:last], dtype=np.float64),
        peak_index=peak - first,
        rise_index=rise - first,
        width_s=width,
        baseline=baseline,
        peak=height,
    )


def quiet_part(shot: Shot) -> NDArray[np.float64]:
    """Return the samples before the pulse, with a margin so that no contact is among them.

    Parameters
    ----------
    shot : Shot
        The recording.

    Returns
    -------
    ndarray, shape (n,)
        Possibly empty. [unit of the signal]
    """
    rise, _, fall, _, _ = _first_pulse(shot)
    margin = max(16, (fall - rise) // 2)
    return shot.signal[: max(0, min(rise, shot.trigger_index) - margin)]


def campaign_noise(shots: list[Shot]) -> NoiseModel:
    """Return one noise model for shots of one instrument.

    Parameters
    ----------
    shots : list of Shot
        At least one.

    Returns
    -------
    NoiseModel
        From the pre-trigger parts, else from differences (and then it says so).
    """
    quanta = [s.quantum for s in shots if s.quantum is not None]
    found = estimate_noise([quiet_part(s) for s in shots], quantum=max(quanta, default=None))
    return found or noise_from_differences([s.signal for s in shots])
