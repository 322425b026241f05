r"""Noise that rises like 1/f towards low frequency: found, measured, and whitened.

.. math:: S(f) = S_{AR}(f) + A / f

What an electronic amplifier adds below some kilohertz. The density is fitted to the spectrum of
quiet stretches by Whittle's likelihood; the filter that whitens it is the long autoregression which
noise of that density obeys, computed and not fitted.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft
from scipy.linalg import solve_toeplitz, solve_triangular, toeplitz
from scipy.optimize import minimize

from analysis.quiet_spectrum import Spectrum, slow_covariance

Array = NDArray[np.float64]

LONG_ORDER = 256
"""Taps of the filter that whitens 1/f: it holds down to a few hundredths of its inverse."""
CORNERS = (1e-3, 1e-2)
"""Cycles per sample from which the search for a corner begins."""
FURTHEST_CORNER = 0.5
"""A corner beyond half the sample rate is colour of another kind than 1/f."""
DOUBTED = 9.0
"""Fall of twice the logarithm of the likelihood, three standard deviations, that ends what noise
may be."""
LEAST_CORNER = 1e-6
"""Cycles per sample below which no corner is tried."""
_GRID = 1 << 14


@dataclass(frozen=True)
class Slow:
    """Autoregressive noise with a 1/f part.

    Attributes
    ----------
    short : ndarray, shape (p,)
        Coefficients of the autoregressive part.
    innovation : float
        Variance of its innovations. [unit of the signal squared]
    amplitude : float
        A; 0 without a 1/f part. [unit of the signal squared]
    likelihood : float
        Logarithm, constants left out.
    """

    short: Array
    innovation: float
    amplitude: float
    likelihood: float

    @property
    def corner(self) -> float:
        """Return where 1/f meets the rest at low frequency. [cycles per sample]"""
        return self.amplitude * float(1.0 - self.short.sum()) ** 2 / self.innovation


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
    return Slow(short, level, 0.0, _likelihood(seen, level * shape))


def _from_reflections(reflections: Array) -> Array:
    """Return autoregressive coefficients, stationary for reflections below 1 (Durbin)."""
    a = np.zeros(0)
    for r in reflections:
        a = np.append(a - r * a[::-1], r)
    return a


def with_slow_part(seen: Spectrum, order: int) -> Slow:
    """Return the best autoregressive noise of an order with a 1/f part.

    Parameters
    ----------
    seen : Spectrum
        Of quiet stretches.
    order : int
        Of the autoregressive part.

    Returns
    -------
    Slow
        At the largest likelihood.
    """
    level = float(np.median(seen.power / seen.white)) / 0.9

    def model_of(point: Array) -> Slow:
        """Return the noise at a point of the search."""
        short = _from_reflections(np.tanh(point[2:]))
        innovation = level * math.exp(point[0])
        return Slow(short, innovation, innovation * math.exp(point[1]), 0.0)

    def cost(point: Array) -> float:
        """Return minus the logarithm of the likelihood per line."""
        if np.any(np.abs(point) > 30.0):
            return 1e9
        found = _likelihood(seen, expected_power(seen, model_of(point)))
        return -found / seen.samples

    best: tuple[float, Array] | None = None
    for corner in CORNERS:
        start = np.concatenate([[0.0, math.log(corner)], np.zeros(order)])
        found = minimize(cost, start, method="L-BFGS-B")
        if best is None or found.fun < best[0]:
            best = (float(found.fun), np.asarray(found.x))
    assert best is not None
    made = model_of(best[1])
    return Slow(made.short, made.innovation, made.amplitude, -best[0] * seen.samples)


def largest_corner(seen: Spectrum, short: Array) -> float:
    """Return how large a 1/f part may be, found or not. [cycles per sample]

    Parameters
    ----------
    seen : Spectrum
        Of quiet stretches.
    short : ndarray, shape (p,)
        Coefficients of the autoregressive part, which stay.

    Returns
    -------
    float
        The corner at which the likelihood, at its best level, has fallen by `DOUBTED`.
    """
    fast = seen.white * _shape(short, seen.frequency)
    at_zero = float(_shape(short, np.zeros(1))[0])

    def likelihood(corner: float) -> float:
        """Return the logarithm of the largest likelihood with a corner."""
        expected = fast + corner * at_zero * seen.slow
        level = float(np.average(seen.power / expected, weights=seen.lines))
        return _likelihood(seen, level * expected)

    tried = np.geomspace(LEAST_CORNER, FURTHEST_CORNER, 60)
    found = np.array([likelihood(float(c)) for c in tried])
    allowed = np.flatnonzero(2.0 * (found.max() - found) <= DOUBTED)
    return float(tried[allowed[-1]])


def whitening_filter(model: Slow, taps: int = LONG_ORDER) -> tuple[Array, float, Array]:
    """Return the long autoregression that noise with a 1/f part obeys, and how it begins.

    Parameters
    ----------
    model : Slow
        The noise.
    taps : int
        How many samples back.

    Returns
    -------
    coefficients : ndarray, shape (taps,)
        a_1 .. a_p.
    variance : float
        Of what they cannot foretell. [unit of the signal squared]
    head : ndarray, shape (taps, taps)
        Lower triangle that whitens the first samples to that variance.
    """
    density = model.innovation * _shape(model.short, np.arange(_GRID // 2 + 1) / _GRID)
    gamma = irfft(density, _GRID)[: taps + 1] + model.amplitude * slow_covariance(taps)
    a = np.asarray(solve_toeplitz(gamma[:-1], gamma[1:]))
    variance = float(gamma[0] - a @ gamma[1:])
    root = np.linalg.cholesky(toeplitz(gamma[:-1]))
    head = solve_triangular(root, math.sqrt(variance) * np.eye(taps), lower=True)
    return a, variance, np.asarray(head)


def variance_within(model: Slow, samples: int) -> float:
    """Return the variance of noise within a stretch about the stretch's own mean.

    Parameters
    ----------
    model : Slow
        The noise.
    samples : int
        Of the stretch.

    Returns
    -------
    float
        [unit of the signal squared]
    """
    density = _shape(model.short, np.arange(_GRID // 2 + 1) / _GRID)
    gamma = slow_covariance(samples - 1)
    weights = 2.0 * (samples - np.arange(samples)) / samples**2
    weights[0] = 1.0 / samples
    slow = float(gamma[0] - weights @ gamma)
    return model.innovation * float(irfft(density, _GRID)[0]) + model.amplitude * slow


def drift_expected(seen: Spectrum, model: Slow) -> float:
    """Return what noise leaves in the slow part that is taken off. [unit of the signal squared]"""
    level = model.innovation * float(_shape(model.short, np.zeros(1))[0])
    return level * seen.drift_white + model.amplitude * seen.drift_slow
