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
_NOISE_SAMPLES = 200
_NOISE_MULTIPLE = 8.0
"""Thousands of samples of noise alone reach 4.5 times their standard deviation, never this."""


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
        Largest excursion from the baseline, > 0. [unit of the signal]
    polarity : int
        +1, or -1 where compression was recorded as negative; ``signal``, ``baseline`` and ``peak``
        are already turned round.
    """

    first: int
    signal: NDArray[np.float64]
    peak_index: int
    rise_index: int
    width_s: float
    baseline: float
    peak: float
    polarity: int


@dataclass(frozen=True)
class _Pulse:
    """Where the pulse nearest the trigger is, in the record's own indices, compression positive."""

    rise: int
    peak: int
    fall: int
    baseline: float
    height: float
    polarity: int


def _first_pulse(shot: Shot) -> _Pulse:
    """Return the pulse nearest after the trigger."""
    x = shot.signal
    search = max(64, int(5e-3 * shot.sample_rate_hz))
    low = max(0, shot.trigger_index - search // 4)
    high = min(x.size, shot.trigger_index + search)
    quiet = x[max(0, low - 2000) : max(1, shot.trigger_index - 8)]
    baseline = float(np.median(quiet)) if quiet.size >= 8 else float(np.median(x))
    near = x[low:high] - baseline
    polarity = 1 if near.max() >= -near.min() else -1
    near = polarity * near
    peak = low + int(np.argmax(near))
    height = float(near.max())
    if not height > 0:
        raise ShotRejectedError(
            f"{shot.name}: nothing leaves the baseline within {search} samples of the trigger; "
            f"the trigger index {shot.trigger_index} may be wrong."
        )
    noise = float(np.median(np.abs(quiet - baseline))) / 0.6745 if quiet.size else 0.0
    if quiet.size >= _NOISE_SAMPLES and height < _NOISE_MULTIPLE * noise:
        raise ShotRejectedError(
            f"{shot.name}: the largest excursion within {search} samples of the trigger is "
            f"{height:.3g}, no more than noise of {noise:.3g} does by itself; the sphere may not "
            "have fallen, or the cell is not connected."
        )
    above = polarity * (x - baseline) > _EDGE * height
    rise = peak
    while rise > 0 and above[rise - 1]:
        rise -= 1
    fall = peak
    while fall + 1 < x.size and above[fall + 1]:
        fall += 1
    return _Pulse(rise, peak, fall, polarity * baseline, height, polarity)


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
        If no pulse leaves the baseline near the trigger.
    """
    pulse = _first_pulse(shot)
    rate = shot.sample_rate_hz
    width = (pulse.fall - pulse.rise + 1) / rate
    before = math.ceil(max(MIN_PRE_S, PRE_PULSES * width) * rate)
    after = math.ceil(max(MIN_POST_S, POST_PULSES * width) * rate)
    first = max(0, pulse.rise - min(before, MAX_SAMPLES // 4))
    last = min(shot.signal.size, pulse.peak + min(after, 3 * MAX_SAMPLES // 4))
    return Window(
        first=first,
        signal=pulse.polarity * np.ascontiguousarray(shot.signal[first:last], dtype=np.float64),
        peak_index=pulse.peak - first,
        rise_index=pulse.rise - first,
        width_s=width,
        baseline=pulse.baseline,
        peak=pulse.height,
        polarity=pulse.polarity,
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
    pulse = _first_pulse(shot)
    margin = max(16, (pulse.fall - pulse.rise) // 2)
    return shot.signal[: max(0, min(pulse.rise, shot.trigger_index) - margin)]


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
