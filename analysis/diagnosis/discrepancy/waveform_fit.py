r"""A waveform that hits have in common, fitted to each with size, shift, stretch and offset.

.. math:: y(t) = a\, W(u) + \sum_k c_k V_k(u) + b, \qquad u = (t - \Delta) / s

W is a mean of hits and V_k are modes of variation, as cubic splines at full resolution. Sample j of
a hit lies at ``place + pace * j`` on the waveform's grid, which turns shift and stretch into two
numbers that enter linearly; beyond the grid's ends a waveform stays what it is there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import spline_filter1d

from analysis.fit.problem import FitShot

Array = NDArray[np.float64]
Start = tuple[float, float]
"""Place and pace."""

SHARES = (1.0, 0.5, 0.25, 0.1)
"""Of a step, tried until one helps."""
AGREED = 1e-5
"""Relative fall of the squares at which a fit ends: an error is told to three digits."""
LARGEST_STRETCH = 0.2
"""Of one step. Chosen by trial: a wrong first slope may ask for a hit without length, and a step
that does not help is shortened anyway."""
RIDGE = 1e-13
"""On columns of length one: rounding, where two are alike."""


@njit(cache=True, nogil=True)
def _weights(t: float) -> tuple[float, float, float, float]:
    """Return what four neighbouring coefficients of a cubic spline count at a share of a step."""
    r = 1.0 - t
    return (
        r * r * r / 6.0,
        (4.0 - 6.0 * t * t + 3.0 * t * t * t) / 6.0,
        (4.0 - 6.0 * r * r + 3.0 * r * r * r) / 6.0,
        t * t * t / 6.0,
    )


@njit(cache=True, nogil=True)
def sampled(spline: Array, place: float, pace: float, count: int) -> Array:
    """Return a spline at evenly spaced places, those beyond its ends at these. Shape (count,)."""
    last = spline.size - 3.0
    found = np.empty(count)
    for j in range(count):
        at = min(max(place + pace * j, 0.0), last)
        i = min(int(at), spline.size - 4)
        w0, w1, w2, w3 = _weights(at - i)
        found[j] = w0 * spline[i] + w1 * spline[i + 1] + w2 * spline[i + 2] + w3 * spline[i + 3]
    return found


@njit(cache=True, nogil=True)
def _products(splines: Array, sizes: Array, signal: Array, place: float, pace: float) -> Array:
    """Return the products of all columns: shapes, one, slope, slope times j, and the signal."""
    shapes, last = splines.shape[0], splines.shape[1] - 3.0
    found = np.zeros((shapes + 4, shapes + 4))
    column = np.ones(shapes + 4)
    for j in range(signal.size):
        raw = place + pace * j
        at = min(max(raw, 0.0), last)
        i = min(int(at), splines.shape[1] - 4)
        t = at - i
        r = 1.0 - t
        w0, w1, w2, w3 = _weights(t)
        slope = 0.0
        for k in range(shapes):
            a, b, c, d = splines[k, i], splines[k, i + 1], splines[k, i + 2], splines[k, i + 3]
            column[k] = w0 * a + w1 * b + w2 * c + w3 * d
            if raw == at:
                turn = -r * r * a + (3.0 * t * t - 4.0 * t) * b - (3.0 * r * r - 4.0 * r) * c
                slope += 0.5 * sizes[k] * (turn + t * t * d)
        column[shapes + 1], column[shapes + 2], column[shapes + 3] = slope, slope * j, signal[j]
        for k in range(shapes + 4):
            for other in range(k + 1):
                found[k, other] += column[k] * column[other]
    for k in range(shapes + 4):
        for other in range(k):
            found[other, k] = found[k, other]
    return found


def padded_spline(values: Array) -> Array:
    """Return cubic spline coefficients along the last axis, mirrored by one at either end."""
    found = np.asarray(spline_filter1d(values, order=3), dtype=np.float64)
    width = [(0, 0)] * (values.ndim - 1) + [(1, 1)]
    return np.pad(found, width, mode="reflect")


@dataclass(frozen=True)
class Hit:
    """One record, or what a model leaves of it, over its fit window.

    Attributes
    ----------
    signal : ndarray, shape (n,)
        The samples. [unit of the signal]
    spline : ndarray, shape (n + 2,)
        Their cubic spline.
    first_s : float
        Time of the first sample, counted from the rise of the pulse. [s]
    rate_hz : float
        Sampling rate. [Hz]
    width_s : float
        Of the pulse. [s]
    size, offset : float
        First guesses. [unit of the signal]
    """

    signal: Array
    spline: Array
    first_s: float
    rate_hz: float
    width_s: float
    size: float
    offset: float

    @classmethod
    def of(cls, item: FitShot, residual: Array | None = None) -> Hit:
        """Return the record of a shot, or what a model leaves of it."""
        window, rate = item.window, item.frame.sample_rate_hz
        signal = window.signal if residual is None else residual
        size, offset = (window.peak, window.baseline) if residual is None else (1.0, 0.0)
        first = -window.rise_index / rate
        return cls(signal, padded_spline(signal), first, rate, window.width_s, size, offset)


@dataclass(frozen=True)
class Waveform:
    """A mean and its modes on a grid of times.

    Attributes
    ----------
    begin_s, step_s : float
        First point and spacing of the grid. [s]
    shapes : ndarray, shape (1 + modes, m)
        Mean and modes as a typical training hit has them. [unit of the signal]
    splines : ndarray, shape (1 + modes, m + 2)
        Their cubic splines.
    width_s : float
        Geometric mean of the training pulses' widths. [s]
    """

    begin_s: float
    step_s: float
    shapes: Array
    splines: Array
    width_s: float

    def start(self, hit: Hit, stretch: float) -> Start:
        """Return where a hit lies whose pulse rises where the waveform's does."""
        pace = 1.0 / (hit.rate_hz * self.step_s * stretch)
        return hit.first_s * hit.rate_hz * pace - self.begin_s / self.step_s, pace

    def starts(self, hit: Hit) -> list[Start]:
        """Return where a fit may begin: as long as the waveform, or as the pulse's width says."""
        return [self.start(hit, 1.0), self.start(hit, hit.width_s / self.width_s)]

    def stretch(self, hit: Hit, placed: Placed) -> float:
        """Return how many times longer than the waveform a hit is. [1]"""
        return 1.0 / (hit.rate_hz * self.step_s * placed.pace)


@dataclass(frozen=True)
class Placed:
    """Where a hit lies on a waveform, and how large it is.

    Attributes
    ----------
    place, pace : float
        Of the first sample, and from sample to sample. [grid step]
    sizes : ndarray, shape (2 + modes,)
        Of the mean and the modes, 1 being typical, and the offset. [1], [unit of the signal]
    squares : float
        What is left.
    """

    place: float
    pace: float
    sizes: Array
    squares: float


def fit_hit(
    wave: Waveform, hit: Hit, starts: Sequence[Start], steps: int, sizes: Array | None = None
) -> Placed:
    """Return a waveform fitted to a hit by least squares.

    Parameters
    ----------
    wave : Waveform
        What is fitted.
    hit : Hit
        To what.
    starts : sequence of tuple of float
        Where to begin; the best is taken.
    steps : int
        Of Gauss and Newton, at most.
    sizes : ndarray, shape (2 + modes,), optional
        About what will be found, where that is known.

    Returns
    -------
    Placed
        Never worse than the best start.
    """
    guess = np.zeros(len(wave.splines)) if sizes is None else sizes
    found = [_at(wave, hit, start, guess) for start in dict.fromkeys(starts)]
    best, products = min(found, key=lambda one: one[0].squares)
    if sizes is None:  # slopes are those of sizes
        best, products = _at(wave, hit, (best.place, best.pace), best.sizes)
    for _ in range(steps):
        later, longer = _solved(products, len(products) - 1)[-2:]
        longer = float(np.clip(longer, -LARGEST_STRETCH * best.pace, LARGEST_STRETCH * best.pace))
        for share in SHARES:
            start = best.place + share * float(later), best.pace + share * longer
            there, ahead = _at(wave, hit, start, best.sizes)
            if there.squares < best.squares:
                break
        else:
            break
        small = best.squares - there.squares < AGREED * best.squares
        best, products = there, ahead
        if small:
            break
    return best


def residual(wave: Waveform, hit: Hit, placed: Placed) -> Array:
    """Return what a waveform leaves of a hit. Shape (n,). [unit of the signal]"""
    left = hit.signal - placed.sizes[-1]
    for size, spline in zip(placed.sizes, wave.splines, strict=False):
        left -= size * sampled(spline, placed.place, placed.pace, left.size)
    return np.asarray(left, dtype=np.float64)


def _at(wave: Waveform, hit: Hit, start: Start, sizes: Array) -> tuple[Placed, Array]:
    """Return the best sizes at a place, and all products with slopes of these sizes."""
    products = _products(wave.splines, sizes, hit.signal, *start)
    linear = len(wave.splines) + 1
    found = _solved(products, linear)
    squares = products[-1, -1] - float(found @ products[:linear, -1])
    return Placed(*start, found, max(squares, 0.0)), products


@njit(cache=True, nogil=True)
def _solved(products: Array, count: int) -> Array:
    """Return the least-squares sizes of so many columns, fitted to the last. Shape (count,)."""
    scale = np.ones(count)
    for k in range(count):
        if products[k, k] > 0.0:
            scale[k] = math.sqrt(products[k, k])
    matrix, load = np.empty((count, count)), np.empty(count)
    for k in range(count):
        load[k] = products[k, -1] / scale[k]
        for other in range(count):
            matrix[k, other] = products[k, other] / (scale[k] * scale[other])
        matrix[k, k] += RIDGE
    return np.linalg.solve(matrix, load) / scale
