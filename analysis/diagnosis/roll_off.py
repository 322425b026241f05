r"""A low-pass filter recognised from the spectrum of the noise.

The quietest stretch of the records, before the pulses or at their ends, is taken as noise. Its
spectrum S is that of white noise behind a filter of one number, where Whittle's likelihood

.. math:: 2 \ln L = -2 K \sum_j \left( P_j / S_j + \ln S_j \right)

of K averaged periodograms P says so: the filter explains what any smooth spectrum explains beyond a
flat one. Noise that is coloured as a mounting moves, or falls at one end of the band alone, is no
such filter's. Nor is noise behind one analogue pole told: sampled, it is autoregressive of order
one, the commonest colour that noise has by itself.

Noise of any colour shows a digital filter of n poles by what is left at half the sampling rate.
There the bilinear transform has n zeros,

.. math:: \ln S = \text{smooth} + n \ln \cos^2 (\pi f / f_s),

while what passes an analogue filter is folded back and filled up by the converter's steps. Where
such a filter cuts, the zeros do not say.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.signal import butter, freqz, get_window, welch
from scipy.special import binom

from analysis.aliases import Array
from analysis.campaign import Shot
from analysis.diagnosis.criteria import CRITERIA
from analysis.fit.window import quiet_part

SEGMENT = 64
"""Samples of a periodogram: so many are there before most pulses."""
OVER_RATE = np.arange(4, SEGMENT // 2) / SEGMENT
"""Frequencies over the sampling rate. Below are drift, hum and what still rings; half the rate
itself counts only half."""
ALIKE = 1.0 + 2.0 * (4.0 / 9.0 + 1.0 / 36.0)
"""How many neighbouring lines of Hann's window make one that is independent."""
SMOOTH_NUMBERS = 6
"""Cosines of a smooth logarithm of a spectrum, besides its mean: the wall of a low-pass of two
poles at a third of the rate is followed within 1 dB."""
HIGHEST = 0.49
"""Cut-off over the sampling rate, from which the spectrum is flat."""
ANALOGUE = "sampled"
"""A resistor and a capacitor before the converter."""
FORMS = {
    ANALOGUE: "amplifier_lowpass",
    "first": "amplifier_lowpass",
    "second": "amplifier_lowpass:second_order",
}
"""That one; digital filters of one and two poles."""
BY_ZEROS = {0.0: None, 0.5: None, 1.0: FORMS["first"], 2.0: FORMS["second"]}
"""Forms by their zeros at half the rate. Half a zero is a spectrum that merely falls there."""


@dataclass(frozen=True)
class RollOff:
    """The low-pass that noise has gone through."""

    form: str
    """Id of the effect's form."""
    cutoff_hz: float | None
    """None where the noise does not say."""
    stretch: str
    """Where the noise is."""


@dataclass(frozen=True)
class _Floor:
    """The mean periodogram of a stretch of all records."""

    power: Array
    count: float
    """How many periodograms it is the mean of, were all lines independent."""
    stretch: str

    def squares(self, spectrum: Array) -> float:
        """Return minus twice the logarithm of the likelihood, at the best size."""
        at_best = spectrum * np.mean(self.power / spectrum)
        return float(2.0 * self.count * np.sum(self.power / at_best + np.log(at_best)))

    def smooth_squares(self, zeros: float = 0.0) -> float:
        """Return the same of the best smooth spectrum with so many zeros at half the rate."""
        falling = _ln_fall(zeros)
        cosines = np.cos(2.0 * np.pi * np.outer(OVER_RATE, np.arange(SMOOTH_NUMBERS + 1)))
        start = np.linalg.lstsq(cosines, np.log(self.power) - falling, rcond=None)[0]

        def squares(coefficients: Array) -> float:
            ln = cosines @ coefficients + falling
            return float(2.0 * self.count * np.sum(self.power * np.exp(-ln) + ln))

        return float(minimize(squares, start).fun)


def roll_off(shots: Sequence[Shot]) -> RollOff | None:
    """Return the low-pass that the noise of records of one rate shows; None where it shows none."""
    if len({shot.sample_rate_hz for shot in shots}) != 1:
        return None
    floor = _quietest(shots)
    if floor is None:
        return None
    of_white = _of_white_noise(floor)
    if of_white is not None:
        form, cutoff = of_white
        return RollOff(form, cutoff * shots[0].sample_rate_hz, floor.stretch)
    squares = {zeros: floor.smooth_squares(zeros) for zeros in BY_ZEROS}
    best = min(squares, key=lambda zeros: squares[zeros])
    found_form = BY_ZEROS[best]
    if found_form is None or squares[0.0] - squares[best] < CRITERIA.least_lead:
        return None
    return RollOff(found_form, None, floor.stretch)


def _of_white_noise(floor: _Floor) -> tuple[str, float] | None:
    """Return the form that white noise passed, and its cut-off over the sampling rate."""
    flat = floor.squares(np.ones_like(OVER_RATE))
    squares, cutoff, form = min((*_best_cutoff(floor, form), form) for form in FORMS)
    gain = flat - squares
    if form == ANALOGUE:
        return None
    if not 1.01 * OVER_RATE[0] < cutoff < 0.99 * HIGHEST:
        return None  # on a bound it is no cut-off
    share = 1.0 - CRITERIA.little
    least = CRITERIA.least_lead + CRITERIA.price_of_number
    if gain < least or gain < share * (flat - floor.smooth_squares()):
        return None
    return FORMS[form], cutoff


def _quietest(shots: Sequence[Shot]) -> _Floor | None:
    ends = [shot.signal[-(shot.signal.size // 3) :] for shot in shots]
    before = [quiet_part(shot) for shot in shots]
    floors = [
        floor
        for stretches, where in ((before, "before the pulses"), (ends, "at the records' ends"))
        if (floor := _floor(stretches, where)) is not None
    ]
    return min(floors, key=lambda floor: float(floor.power.mean()), default=None)


def _floor(stretches: list[Array], where: str) -> _Floor | None:
    kept = [one for one in stretches if one.size >= SEGMENT]
    if not kept:
        return None
    counts = [2 * (one.size // SEGMENT) - 1 for one in kept]
    by_length: dict[int, list[Array]] = {}
    for one in kept:
        by_length.setdefault(one.size, []).append(one - one.mean())
    powers = sum(
        (2 * (size // SEGMENT) - 1) * welch(np.array(alike), nperseg=SEGMENT)[1].sum(axis=0)
        for size, alike in by_length.items()
    )
    power = np.asarray(powers)[4:-1] / sum(counts)
    return _Floor(power, sum(counts) / ALIKE, where) if np.all(power > 0.0) else None


def _best_cutoff(floor: _Floor, form: str) -> tuple[float, float]:
    found = minimize_scalar(
        lambda ln: floor.squares(_spectrum(form, math.exp(ln))),
        bounds=(math.log(OVER_RATE[0]), math.log(HIGHEST)),
        method="bounded",
    )
    return float(found.fun), math.exp(float(found.x))


def _ln_fall(zeros: float) -> Array:
    """Return the logarithm of white noise's mean periodogram behind zeros at half the rate.

    A window that ends lets the neighbours of a zero leak into it: the noise's autocorrelation is
    weighted with the window's own. Of half a zero more it is the mean of both.
    """
    fewer, more = math.floor(zeros), math.ceil(zeros)
    if fewer != more:
        return 0.5 * (_ln_fall(fewer) + _ln_fall(more))
    window = get_window("hann", SEGMENT)
    weight = np.correlate(window, window, "full")[SEGMENT - 1 :][: fewer + 1]
    taps = binom(fewer, np.arange(fewer + 1))
    products = weight * np.correlate(taps, taps, "full")[fewer:]
    lags = np.arange(1, fewer + 1)
    angles = 2.0 * np.pi * np.outer(OVER_RATE, lags)
    return np.asarray(np.log(products[0] + 2.0 * np.cos(angles) @ products[1:]))


def _spectrum(form: str, cutoff: float) -> Array:
    """Return what a filter leaves of white noise; ``cutoff`` is over the sampling rate."""
    if form == ANALOGUE:
        decay = math.exp(-2.0 * math.pi * cutoff)
        angles = 2.0 * np.pi * OVER_RATE
        return np.asarray(1.0 / (1.0 - 2.0 * decay * np.cos(angles) + decay**2))
    b, a = butter(1 if form == "first" else 2, cutoff, fs=1.0)
    return np.asarray(np.abs(freqz(b, a, worN=OVER_RATE, fs=1.0)[1]) ** 2)
