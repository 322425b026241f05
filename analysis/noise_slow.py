r"""Noise that rises towards low frequency: found, measured, and whitened.

.. math:: S(f) = S_{AR}(f) + A / f^s

What an electronic amplifier adds below some kilohertz: flicker noise has a slope s of 1, and noise
that was integrated, as a charge amplifier does with the current of its input, of 2. The density is
fitted to the spectrum of quiet stretches by Whittle's likelihood; the filter that whitens it is the
long autoregression which noise of that density obeys, computed and not fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft
from scipy.linalg import solve_toeplitz, solve_triangular, toeplitz

from analysis.aliases import Array
from analysis.quiet_spectrum import Spectrum, slow_covariance

LONG_ORDER = 256
"""Taps of the filter that whitens a slow part: it holds down to a few hundredths of its inverse."""
FURTHEST_CORNER = 0.5
"""A corner beyond half the sample rate is colour of another kind than a slow part."""
DOUBTED = 9.0
"""Fall of twice the logarithm of the likelihood, three standard deviations, that ends what noise
may be."""
LEAST_CORNER = 1e-6
"""Cycles per sample below which no corner is tried."""
_GRID = 1 << 14
_CORNERS = np.geomspace(LEAST_CORNER, FURTHEST_CORNER, 60)
_TURN_STEP = 1e-6
_LARGEST_REFLECTION = 1.0 - 1e-9
_MOST_TURNED = 10.0
"""A reflection of 1 - 4e-9: beyond it noise is a tone."""
_MOST_RATIO = 1e4
"""Of the slow part to innovations: beyond it hardly any are left, and no corner is in sight."""
_CLIMB_STEPS = 60
_CLIMBED = 1e-3
"""Gain in the likelihood's logarithm below which nothing depends on it: prices are of order 6."""


@dataclass(frozen=True)
class Slow:
    """Autoregressive noise with a part that rises towards low frequency."""

    short: Array
    """Coefficients of the autoregressive part, shape (p,)."""
    innovation: float
    """Variance of its innovations. [unit of the signal squared]"""
    amplitude: float
    """A; 0 without a slow part. [unit of the signal squared]"""
    likelihood: float
    """Logarithm, constants left out."""
    slope: int = 1
    """s, 1 or 2."""

    @property
    def corner(self) -> float:
        """Return where the slow part meets the rest at low frequency. [cycles per sample]"""
        ratio = self.amplitude * float(1.0 - self.short.sum()) ** 2 / self.innovation
        return float(ratio ** (1.0 / self.slope))


def _shape(short: Array, frequency: Array) -> Array:
    """Return the density of autoregressive noise with innovations of 1."""
    response = np.ones(frequency.size, dtype=complex)
    for j, a in enumerate(short, start=1):
        response -= a * np.exp(-2j * np.pi * frequency * j)
    return np.asarray(1.0 / np.abs(response) ** 2)


def expected_power(seen: Spectrum, model: Slow) -> Array:
    """Return what a spectrum's powers are expected to be. [unit of the signal squared]"""
    fast = model.innovation * _shape(model.short, seen.frequency)
    return np.asarray(fast * seen.white + model.amplitude * seen.slow)


def _likelihood(seen: Spectrum, expected: Array) -> float:
    found = np.sum(seen.lines * (np.log(expected) + seen.power / expected))
    return -0.5 * seen.pieces * float(found)


def autoregressive(seen: Spectrum, short: Array) -> Slow:
    """Return autoregressive noise of given coefficients at its best level."""
    shape = seen.white * _shape(short, seen.frequency)
    level = float(np.average(seen.power / shape, weights=seen.lines))
    return Slow(short, level, 0.0, _likelihood(seen, level * shape), seen.slope)


def _from_reflections(reflections: Array) -> Array:
    """Return autoregressive coefficients, stationary for reflections below 1 (Durbin)."""
    a = np.zeros(0)
    for r in reflections:
        a = np.append(a - r * a[::-1], r)
    return a


def _profile(seen: Spectrum, shape: Array) -> Array:
    """Return the largest likelihood with each of `_CORNERS`, the autoregressive shape kept."""
    expected = shape * seen.white + _CORNERS[:, None] ** seen.slope * seen.slow
    level = np.average(seen.power / expected, weights=seen.lines, axis=1)
    found = np.log(level[:, None] * expected) @ seen.lines
    # at its best level a line's power is on average what is expected of it
    return np.asarray(-0.5 * seen.pieces * (found + seen.lines.sum()))


def _made(seen: Spectrum, ratio: float, turns: Array) -> Slow:
    """Return noise of a shape, slow part over innovation and reflections, at its best level."""
    short = _from_reflections(np.tanh(turns))
    shape = _shape(short, seen.frequency) * seen.white + ratio * seen.slow
    level = float(np.average(seen.power / shape, weights=seen.lines))
    return Slow(short, level, ratio * level, _likelihood(seen, level * shape), seen.slope)


def _scores(seen: Spectrum, at: Slow, turns: Array) -> tuple[Array, Array]:
    """Return Fisher's score and information of (ln level, ratio, turns), see `_made`."""
    waves = np.exp(-2j * np.pi * seen.frequency * np.arange(1, turns.size + 1)[:, None])
    response = 1.0 - at.short @ waves
    bent = np.empty((turns.size, turns.size))
    for j in range(turns.size):
        moved = turns.copy()
        moved[j] += _TURN_STEP
        bent[j] = (_from_reflections(np.tanh(moved)) - at.short) / _TURN_STEP
    shape = seen.white / np.abs(response) ** 2
    whole = shape + at.amplitude / at.innovation * seen.slow
    slopes = np.empty((2 + turns.size, seen.frequency.size))
    slopes[0], slopes[1] = 1.0, seen.slow / whole
    slopes[2:] = bent @ (2.0 * (waves / response).real) * (shape / whole)
    weighted = 0.5 * seen.pieces * seen.lines * slopes
    score = weighted @ (seen.power / (at.innovation * whole) - 1.0)
    return np.asarray(score), np.asarray(weighted @ slopes.T)


def promised_gain(seen: Spectrum, short: Array) -> float:
    """Return by how much twice the likelihood's logarithm would rise by a slow part (score test).

    ``short`` are the coefficients of autoregressive noise from which it is computed. The gain is
    that of a likelihood that is a parabola, 0 where a slow part would have to be negative.

    Source: Rao's score test. For lines above what is expected of them it promises more than they
    bring (x - 1 squared, where the likelihood has 2 (x - 1 - ln x)).
    """
    turns = _turns(short)
    score, information = _scores(seen, _made(seen, 0.0, turns), turns)
    kept = np.arange(score.size) != 1
    inner = np.linalg.pinv(information[np.ix_(kept, kept)], hermitian=True)
    cross = information[1, kept] @ inner
    own = float(information[1, 1] - cross @ information[kept, 1])
    free = float(score[1] - cross @ score[kept])
    return free**2 / own if free > 0.0 and own > 0.0 else 0.0


def _turns(short: Array) -> Array:
    """Return inverse hyperbolic tangents of the reflections that make these coefficients."""
    found, a = [], short
    for _ in range(short.size):
        r = float(np.clip(a[-1], -_LARGEST_REFLECTION, _LARGEST_REFLECTION))
        found.append(math.atanh(r))
        a = (a[:-1] + r * a[-2::-1]) / (1.0 - r * r)
    return np.array(found[::-1])


def _climb(seen: Spectrum, ratio: float, turns: Array) -> Slow:
    """Return the nearest largest likelihood: Fisher's scoring, damped where it leads too far."""
    found, damping = _made(seen, ratio, turns), 0.0
    for _ in range(_CLIMB_STEPS):
        score, information = _scores(seen, found, turns)
        information[np.diag_indices_from(information)] *= 1.0 + damping
        # The shortest step: along what no line of the spectrum tells, nothing moves.
        step = np.linalg.lstsq(information, score, rcond=None)[0]
        # a slow part stays positive, and may vanish by steps
        ahead = ratio + float(step[1])
        ahead = ahead if ahead > 0.1 * ratio else 0.1 * ratio
        moved = np.clip(turns + step[2:], -_MOST_TURNED, _MOST_TURNED)
        tried = _made(seen, ahead, moved)
        gain = tried.likelihood - found.likelihood
        if gain > 0.0:
            found, ratio, turns, damping = tried, ahead, moved, 0.1 * damping
        else:
            damping = max(10.0 * damping, 1e-2)
        if abs(gain) < _CLIMBED or ratio > _MOST_RATIO:
            break
    return found


def with_slow_part(seen: Spectrum, short: Array) -> Slow:
    """Return the best autoregressive noise of the order of ``short`` with a slow part.

    It is the largest likelihood found from these coefficients and from white noise.
    """
    starts = [np.zeros(short.size)]
    if short.size:
        starts.append(_turns(short))
    climbed = []
    for turns in starts:
        shape = _shape(_from_reflections(np.tanh(turns)), seen.frequency)
        ratio = float(_CORNERS[int(np.argmax(_profile(seen, shape)))] ** seen.slope)
        climbed.append(_climb(seen, ratio, turns))
    return max(climbed, key=lambda found: found.likelihood)


def largest_corner(seen: Spectrum, short: Array) -> float:
    """Return how large a slow part may be, found or not. [cycles per sample]

    At this corner the likelihood, at its best level, has fallen by `DOUBTED`. The autoregressive
    part ``short`` stays.
    """
    at_zero = float(_shape(short, np.zeros(1))[0])
    found = _profile(seen, _shape(short, seen.frequency) / at_zero)
    allowed = np.flatnonzero(2.0 * (found.max() - found) <= DOUBTED)
    return float(_CORNERS[allowed[-1]])


def whitening_filter(model: Slow, taps: int = LONG_ORDER) -> tuple[Array, float, Array]:
    """Return the long autoregression that noise with a slow part obeys, and how it begins.

    That is the coefficients a_1 .. a_p, the variance of what they cannot predict [unit of the
    signal squared], and the lower triangle that whitens the first samples to that variance, shape
    (taps, taps).
    """
    density = model.innovation * _shape(model.short, np.arange(_GRID // 2 + 1) / _GRID)
    slow = model.amplitude * slow_covariance(taps, model.slope)
    gamma = irfft(density, _GRID)[: taps + 1] + slow
    a = np.asarray(solve_toeplitz(gamma[:-1], gamma[1:]))
    variance = float(gamma[0] - a @ gamma[1:])
    root = np.linalg.cholesky(toeplitz(gamma[:-1]))
    head = solve_triangular(root, math.sqrt(variance) * np.eye(taps), lower=True)
    return a, variance, np.asarray(head)


def variance_within(model: Slow, samples: int) -> float:
    """Return the variance of noise within a stretch about the stretch's own mean.

    [unit of the signal squared]
    """
    density = _shape(model.short, np.arange(_GRID // 2 + 1) / _GRID)
    gamma = slow_covariance(samples - 1, model.slope)
    weights = 2.0 * (samples - np.arange(samples)) / samples**2
    weights[0] = 1.0 / samples
    slow = float(gamma[0] - weights @ gamma)
    return model.innovation * float(irfft(density, _GRID)[0]) + model.amplitude * slow


def drift_expected(seen: Spectrum, model: Slow) -> float:
    """Return what noise leaves in the slow part that is taken off. [unit of the signal squared]"""
    level = model.innovation * float(_shape(model.short, np.zeros(1))[0])
    return level * seen.drift_white + model.amplitude * seen.drift_slow
