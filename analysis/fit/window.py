"""The window of samples that a fit uses, and what the record shows without a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.bounce import TRIGGERED_S
from analysis.campaign import Shot
from analysis.errors import ShotRejectedError
from analysis.hidden_noise import CODES_OF_COARSE
from analysis.noise import NoiseModel, estimate_noise, noise_from_differences
from analysis.quantisation import step_of
from analysis.quiet_spectrum import LONGEST, without_drift

PRE_PULSES = 4.0
POST_PULSES = 12.0
"""The window reaches so many pulse widths before and after the pulse."""
MIN_PRE_S = 0.4e-3
MIN_POST_S = 2.5e-3
"""And at least so far, so that the crystal has rung out."""
MAX_SAMPLES = 6000
FULL_SCALE = (-32768, 32767)
"""First and last code of the converter."""

_EDGE = 0.05
_QUIET_SAMPLES = 8
"""A median of fewer says nothing of where the line is at rest."""
_NOISE_SAMPLES = 200
_FEWEST_QUIET = 32
"""A median of so few is within a third of the noise, and `_NOISE_MULTIPLE` has room for that."""
_NOISE_MULTIPLE = 8.0
"""Thousands of samples of noise alone reach 4.5 times their standard deviation, never this."""
_PIECES = 8
_LEAST_IN_PIECES = _PIECES * _QUIET_SAMPLES
_PRECURSOR = 4.0
"""Times as loud as the loudest of the first half that the last piece must be. Derived: slow hum is
a parabola over the stretch, whose last eighth is at most 3.7 times as steep."""
_BEGUN = 1.2
"""Times as loud, from which it has begun where it is there at all: rather too early than late."""
_RUNG_OUT = 3
"""Pieces that must be alike. Derived: over three a ring falls by 1/1.2 unless it takes more than
1.4 times the whole stretch to fall to 1/e."""
_REPEATED = 3
"""Records in which it must be: in the median of fewer, chance is not told from a precursor."""
_SWING, _SWING_NOISE, _REACH = 0.25, 5.0, 2
"""A swing counts from this share of the largest and this multiple of the noise; it is looked for
so many of its follower's widths before that."""

_FAR = 4
"""Swings are followed so many search lengths beyond the search."""


@dataclass(frozen=True)
class Window:
    """The part of a shot that is fitted."""

    first: int
    """Index in the record."""
    signal: NDArray[np.float64]
    """Shape (n,). [unit of the signal]"""
    peak_index: int
    """Top of the pulse that the contact made, counted within the window; a later swing may be
    larger."""
    rise_index: int
    """Where that pulse first exceeds 5 % of its top, within the window."""
    width_s: float
    """Time above 5 % of that top. [s]"""
    baseline: float
    """Median before the pulse. [unit of the signal]"""
    peak: float
    """Largest excursion from the baseline towards compression, > 0. [unit of the signal]"""
    polarity: int
    """+1, or -1 where compression was recorded as negative; ``signal``, ``baseline`` and ``peak``
    are already turned round."""


@dataclass(frozen=True)
class _Pulse:
    """Where the pulse nearest the trigger is, in the record's own indices, compression positive."""

    rise: int
    peak: int
    fall: int
    baseline: float
    height: float
    polarity: int
    whole: bool
    """Whether its end was seen, or is the record's."""


def _edges(above: NDArray[np.bool_], at: int) -> tuple[int, int]:
    """Return the first and the last index of the run that ``at`` lies in."""
    before, after = np.flatnonzero(~above[:at]), np.flatnonzero(~above[at:])
    first = int(before[-1]) + 1 if before.size else 0
    last = at + int(after[0]) - 1 if after.size else above.size - 1
    return first, last


def _first_swing(x: NDArray[np.float64], largest: int, noise: float) -> int:
    """Return a sample of the swing that began what the largest excursion belongs to.

    A structure that rings, or a cut top, can swing back further than the contact pushed it. If that
    swing were taken for the contact, it would be late by half a period and of the wrong sign.
    """
    height = abs(float(x[largest]))
    level = max(_SWING * height, _SWING_NOISE * noise)
    at = largest
    while True:
        first, last = _edges(np.sign(x[at]) * x > _EDGE * height, at)
        low = max(0, first - _REACH * (last - first + 1))
        earlier = np.flatnonzero(np.abs(x[low:first]) > level)
        if not earlier.size:
            return at
        at = low + int(earlier[-1])


def _first_pulse(shot: Shot, *, strict: bool = False) -> _Pulse:
    """Return the pulse nearest after the trigger; ``strict`` as `pulse_samples` has it."""
    x = shot.signal
    search = max(64, int(TRIGGERED_S * shot.sample_rate_hz))
    low = max(0, shot.trigger_index - search // 4)
    high = min(x.size, shot.trigger_index + search)
    quiet = x[max(0, low - 2000) : max(1, shot.trigger_index - 8)]
    baseline = float(np.median(quiet)) if quiet.size >= _QUIET_SAMPLES else float(np.median(x))
    # a record can hold seconds, a swing milliseconds
    begin = max(0, low - _FAR * search)
    rest = x[begin : high + _FAR * search] - baseline
    largest = low - begin + int(np.argmax(np.abs(rest[low - begin : high - begin])))
    height = abs(float(rest[largest]))
    if not height > 0:
        raise ShotRejectedError(
            f"{shot.name}: nothing leaves the baseline within {search} samples of the trigger; "
            f"the trigger index {shot.trigger_index} may be wrong."
        )
    if strict and quiet.size < _FEWEST_QUIET:
        raise ShotRejectedError(f"{shot.name}: {quiet.size} quiet samples tell nothing of noise.")
    noise = float(np.median(np.abs(quiet - baseline))) / 0.6745 if quiet.size else 0.0
    if (
        quiet.size >= (_FEWEST_QUIET if strict else _NOISE_SAMPLES)
        and height < _NOISE_MULTIPLE * noise
    ):
        raise ShotRejectedError(
            f"{shot.name}: the largest excursion within {search} samples of the trigger is "
            f"{height:.3g}, no more than noise of {noise:.3g} does by itself; the sphere may not "
            "have fallen, or the cell is not connected."
        )
    at = _first_swing(rest, largest, noise)
    polarity = 1 if rest[at] > 0 else -1
    pushed = polarity * rest
    whole = _edges(pushed > 0.0, at)
    top = whole[0] + int(np.argmax(pushed[whole[0] : whole[1] + 1]))
    rise, fall = _edges(pushed > _EDGE * pushed[top], top)
    tallest = float(pushed[min(low - begin, top) : max(high - begin, top + 1)].max())
    return _Pulse(
        begin + rise,
        begin + top,
        begin + fall,
        polarity * baseline,
        tallest,
        polarity,
        whole=fall < rest.size - 1 or begin + rest.size == x.size,
    )


def pulse_samples(shot: Shot, *, strict: bool = False) -> int | None:
    """Return how many samples the pulse near the trigger has above 5 % of its top.

    None if there is no pulse, or if its end is not in the part that is looked at. If ``strict``,
    nothing counts as a pulse that is not compared with noise, even if it is one of few samples.
    """
    try:
        pulse = _first_pulse(shot, strict=strict)
    except ShotRejectedError:
        return None
    return pulse.fall - pulse.rise + 1 if pulse.whole else None


def cut(shot: Shot) -> Window:
    """Return the window of one shot: from well before the pulse until the crystal has rung out.

    It ends before the next bounce. A ShotRejectedError says that no pulse leaves the baseline near
    the trigger.
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


def rail(shot: Shot, window: Window) -> tuple[float, float] | None:
    """Return the lowest and highest value of the converter if a window reaches one of them.

    None where it was never full, or its step is not known. The values are turned round as the
    window is. The converter is one of 16 bits. An amplifier's limit lies below this and is an
    effect, not a known value.
    """
    if shot.quantum is None:
        return None
    low, high = (code * shot.quantum + shot.code_zero for code in FULL_SCALE)
    recorded = window.polarity * window.signal
    least, most = float(recorded.min()), float(recorded.max())
    half = 0.5 * shot.quantum
    if least < low - half or most > high + half:
        return None  # codes beyond 16 bits: this is another converter
    if least >= low + half and most <= high - half:
        return None
    return (low, high) if window.polarity > 0 else (-high, -low)


def quiet_part(shot: Shot) -> NDArray[np.float64]:
    """Return the samples before the pulse, with a margin so that no contact is among them.

    There may be none. [unit of the signal]
    """
    pulse = _first_pulse(shot)
    margin = max(16, (pulse.fall - pulse.rise) // 2)
    return shot.signal[: max(0, min(pulse.rise, shot.trigger_index) - margin)]


def _step(shots: list[Shot], quiet: list[NDArray[np.float64]]) -> float | None:
    """Return the largest step of the converters that made these records, as far as it is known.

    Where the quiet stretches rest on few values, the step may be larger than is stated, and is
    looked for: 8 bits are often kept as 16.
    """
    steps = [s.quantum for s in shots]
    few = [q.size > 0 and np.unique(q).size <= CODES_OF_COARSE for q in quiet]
    for shot, rests in zip(shots, few, strict=True):
        if rests:
            pulse = shot.signal[max(0, shot.trigger_index - LONGEST) :]
            steps.append(step_of(pulse, shot.quantum))
    return max((step for step in steps if step is not None), default=None)


def campaign_noise(shots: list[Shot]) -> NoiseModel:
    """Return one noise model for shots of one instrument, at least one.

    It is made from the pre-trigger parts; else from the ends, where all has rung out; else from
    differences (and then it says so).
    """
    quiet = [quiet_part(s) for s in shots]
    calm = calm_share(quiet)
    seen = quiet
    if calm < 1.0:  # a precursor begins slowly: a parabola takes off what of it is left
        begun = [q[: round(calm * q.size)] for q in quiet]
        seen = [without_drift(q, 2) for q in begun if q.size > _QUIET_SAMPLES]
    found = estimate_noise(
        seen,
        quantum=_step(shots, quiet),
        sample_rate_hz=shots[0].sample_rate_hz,
    )
    if found is not None:
        return replace(found, calm_share=calm)
    ends = quiet_ends(shots)
    found = estimate_noise(ends, quantum=_step(shots, ends), sample_rate_hz=shots[0].sample_rate_hz)
    if found is None:
        return noise_from_differences([s.signal for s in shots])
    return replace(found, source="end")


def quiet_ends(shots: Sequence[Shot]) -> list[NDArray[np.float64]]:
    """Return of each window what is after the ringing, less a parabola; empty where it rings on.

    In eighths of what follows the pulse, from the last one on: those as loud as that within
    `_BEGUN`, and at least `_RUNG_OUT`.
    """
    after = []
    for shot in shots:
        window = cut(shot)
        fall = window.rise_index + round(window.width_s * shot.sample_rate_hz)
        after.append(window.signal[fall:])
    loud = _loudness(after, drift=2)
    last = loud[-1:]
    begun = max((k + 1 for k, one in enumerate(loud) if one > _BEGUN * last[0]), default=0)
    if len(loud) - begun < _RUNG_OUT:
        return [x[:0] for x in after]
    return [without_drift(x[begun * x.size // _PIECES :], 2) for x in after]


def _loudness(stretches: Sequence[NDArray[np.float64]], *, drift: int) -> list[float]:
    """Return the standard deviation in each eighth of stretches, the median of all long enough.

    Beyond a polynomial of degree ``drift``. Empty where none is long enough.
    """
    pieces = [np.array_split(x, _PIECES) for x in stretches if x.size >= _LEAST_IN_PIECES]
    each = [[float(np.std(without_drift(one, drift))) for one in parts] for parts in pieces]
    return [float(one) for one in np.median(each, axis=0)] if each else []


def calm_share(quiet: Sequence[NDArray[np.float64]]) -> float:
    """Return the share of quiet stretches, from their beginning, before a precursor sets in.

    In eighths; 1 if the end is no louder than noise makes it, or if there are few stretches.
    ``quiet`` are the samples before the pulses of one instrument. What falls touches something else
    first, or a filter looks ahead, and the records leave the line before the pulse. Hum and slow
    noise are as loud at the end as before. Validation: the quiet start of recordings with a
    precursor, in ``tests/analysis/fit/test_window.py``.
    """
    if sum(q.size >= _LEAST_IN_PIECES for q in quiet) < _REPEATED:
        return 1.0
    loud = _loudness(quiet, drift=0)
    usual = max(loud[: _PIECES // 2])
    if usual == 0.0 or loud[-1] <= _PRECURSOR * usual:
        return 1.0
    begun = _BEGUN * usual
    return next(k for k in range(_PIECES) if loud[k] > begun) / _PIECES
