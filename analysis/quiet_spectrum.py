r"""The spectrum of quiet intervals, without the part that may be mains hum.

Two things make a quiet stretch wander. Noise whose density rises like 1/f, or like 1/f^2 as behind
an integrator, does it by chance, at all frequencies below its corner. Mains hum does it too, but
over a few milliseconds it is a smooth curve of few numbers, and it is no noise: it is there to be
found. So everything that a signal below `DRIFT_HZ` can do within a stretch is taken off by a
polynomial, and what is left is noise.

The powers of its cosine transform stand beside what they are expected to be for a flat density and
for a rising one, the polynomial taken off there as well: no lines have to be thrown away, and no
leakage is taken for a slope.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.fft import dct, irfft, next_fast_len, rfft
from scipy.special import sici

from analysis.aliases import Array

DRIFT_HZ = 420.0
"""The seventh harmonic of 60 Hz: what lies below may be hum and is not taken for noise."""
DEGREE_PER_RADIAN, LEAST_DEGREE = 0.63, 3
LONGEST = 4096
"""Quiet stretches are looked at in pieces of at most so many samples."""
MOST_NUMBERS = 2**21
"""Of the polynomials that follow the drift of one stretch, 16 MB. Derived: three times what 20 ms
at 1 MHz take, the usual stretch before a trigger; pieces tell as much."""
SHORTEST = 256
"""In pieces shorter than this, drift and 1/f cannot be told apart."""
LOWEST = 2.0**-16
"""Cycles per sample below which a rising density stays flat; no window is long enough to see it."""
SINGLE, STEP = 64, 0.03
"""So many lines stand for themselves, then bands of this relative width do."""
KEPT = 0.5
"""Lines of which the polynomial took more than this say nothing."""
_EXACT_LINES = 384


@dataclass(frozen=True)
class Spectrum:
    """Pooled powers of quiet stretches with their drift taken off."""

    frequency: Array
    """In cycles per sample, shape (k,)."""
    lines: Array
    """How many were put together, more of them at high frequency. Shape (k,)."""
    power: Array
    """Mean over pieces and lines. Shape (k,). [unit of the signal squared]"""
    white: Array
    slow: Array
    """This and ``white`` are what the power is expected to be for a density of 1/f^slope and of 1,
    shape (k,). [1]"""
    pieces: int
    samples: int
    """Of each of the ``pieces`` that were pooled."""
    drift: float
    """Mean square of what was taken off, means aside. [unit of the signal squared]"""
    drift_white: float
    drift_slow: float
    """This and ``drift_white`` are what it is expected to be for a density of 1/f^slope and of 1.
    [1]"""
    degree: int
    slope: int


def drift_degree(samples: int, sample_rate_hz: float) -> int:
    """Return the degree of polynomial that follows anything below `DRIFT_HZ`.

    About four per period of the fastest, and a few; at most a sixteenth of the samples.
    """
    radians = 2.0 * math.pi * DRIFT_HZ * samples / sample_rate_hz
    wanted = math.ceil(DEGREE_PER_RADIAN * radians) + LEAST_DEGREE
    return min(wanted, samples // 16)


def pieces_of(stretch: Array, sample_rate_hz: float) -> list[Array]:
    """Return a stretch as one, or pieces of `LONGEST` samples where its drift takes too much.

    Pieces are counted from the end; a shorter rest at the beginning is left out.
    """
    if stretch.size * drift_degree(stretch.size, sample_rate_hz) <= MOST_NUMBERS:
        return [stretch]
    return list(stretch[stretch.size % LONGEST :].reshape(-1, LONGEST))


@lru_cache(maxsize=16)
def drift_basis(samples: int, degree: int) -> Array:
    """Return orthonormal polynomials over a stretch, the constant first.

    Shape (samples, degree + 1), read only.
    """
    x = np.linspace(-1.0, 1.0, samples)
    q = np.linalg.qr(np.polynomial.legendre.legvander(x, degree))[0]
    q.flags.writeable = False
    return np.asarray(q)


def without_drift(stretch: Array, degree: int) -> Array:
    """Return a stretch less its best polynomial; degree 0 takes off the mean."""
    if degree == 0:
        return np.asarray(stretch - stretch.mean())
    q = drift_basis(stretch.size, degree)
    return np.asarray(stretch - q @ (q.T @ stretch))


def slow_covariance(lags: int, slope: int) -> Array:
    r"""Return the autocovariance of noise with density 1/f or, for a slope of 2, 1/f^2.

    .. math:: \gamma_j = 2 \int_{f_0}^{1/2} \cos(\omega j) / f \, df
        = 2 [Ci(\pi j) - Ci(\omega_0 j)]

    .. math:: \gamma_j = 2 \int_{f_0}^{1/2} \cos(\omega j) / f^2 \, df = 2 [\cos(\omega_0 j) / f_0
        - 2 \cos(\pi j) - 2 \pi j (Si(\pi j) - Si(\omega_0 j))]

    Shape (lags + 1,); the density is flat below `LOWEST`. Source: the sine and cosine integrals, by
    parts for 1/f^2. Validation: against a sum over lines in
    ``tests/analysis/test_quiet_spectrum.py``.
    """
    j = np.arange(lags + 1)
    low, high = 2.0 * np.pi * LOWEST * j, np.pi * j
    flat = 2.0 * LOWEST ** (1 - slope) * np.sinc(2.0 * LOWEST * j)  # the part below LOWEST
    if slope == 1:
        tail = 2.0 * (sici(high[1:])[1] - sici(low[1:])[1])
        return np.asarray(np.concatenate([[2.0 * math.log(0.5 / LOWEST)], tail]) + flat)
    rest = 2.0 * np.pi * j * (sici(high)[0] - sici(low)[0])
    return np.asarray(2.0 * (np.cos(low) / LOWEST - 2.0 * np.cos(high) - rest) + flat)


def slow_powers(columns: Array, slope: int) -> Array:
    """Return the variance of noise with density 1/f^slope along columns, shape (n, k).

    Each is c' G c with G the covariance of `slow_covariance`, by Fourier transform.
    """
    samples = columns.shape[0]
    size = next_fast_len(2 * samples - 1)
    gamma = slow_covariance(samples - 1, slope)
    circle = np.zeros(size)
    circle[:samples] = gamma
    circle[size - samples + 1 :] = gamma[:0:-1]
    density = rfft(circle).real
    moved = irfft(density[:, None] * rfft(columns, size, axis=0), size, axis=0)
    return np.asarray(np.sum(columns * moved[:samples], axis=0))


@lru_cache(maxsize=16)
def _expected(samples: int, degree: int, slope: int) -> tuple[Array, Array, float]:
    """Return each line's power for densities 1 and 1/f^slope, and the drift's for the latter."""
    q = drift_basis(samples, degree)
    white = 1.0 - np.sum(dct(q, type=2, norm="ortho", axis=0) ** 2, axis=1)
    frequency = np.arange(samples) / (2.0 * samples)
    slow = white / np.maximum(frequency, 0.25 / samples) ** slope
    lines = min(_EXACT_LINES, samples)
    basis = dct(np.eye(samples, lines), type=3, norm="ortho", axis=0)
    basis -= q @ (q.T @ basis)
    slow[:lines] = slow_powers(basis, slope)
    return white, slow, float(np.sum(slow_powers(q[:, 1:], slope)))


def pooled_spectrum(
    segments: Sequence[Array], sample_rate_hz: float, slope: int = 1
) -> Spectrum | None:
    """Return the powers of quiet stretches with their drift taken off.

    Beside them stand those of noise that rises with a ``slope`` of 1 or 2. None where they are too
    short to tell drift from noise.
    """
    sizes = sorted((s.size for s in segments), reverse=True)
    if not sizes or sizes[0] < SHORTEST:
        return None
    # the length at which most samples can be used
    samples = max((n * (k + 1), n) for k, n in enumerate(sizes))[1]
    samples = min(samples, LONGEST)
    if samples < SHORTEST:
        return None
    pieces = []
    for segment in segments:
        whole = segment.size // samples
        pieces += np.split(segment[segment.size - whole * samples :], whole) if whole else []
    degree = drift_degree(samples, sample_rate_hz)
    q = drift_basis(samples, degree)
    x = np.stack(pieces)
    taken = x @ q
    lines = dct(x - taken @ q.T, type=2, norm="ortho", axis=1)
    white, slow, drift_slow = _expected(samples, degree, slope)
    keep = np.flatnonzero(white > KEPT)
    single = np.arange(keep.size)
    further = np.log(np.maximum(single, SINGLE) / SINGLE) // STEP
    band = np.where(single < SINGLE, single, SINGLE + further)
    first = np.flatnonzero(np.diff(band, prepend=-1))
    count = np.diff(np.append(first, keep.size)).astype(np.float64)

    def together(values: Array) -> Array:
        """Return the means of bands."""
        return np.asarray(np.add.reduceat(values[keep], first) / count)

    return Spectrum(
        frequency=together(np.arange(samples) / (2.0 * samples)),
        lines=count,
        power=together(np.mean(lines**2, axis=0)),
        white=together(white),
        slow=together(slow),
        pieces=len(pieces),
        samples=samples,
        drift=float(np.mean(np.sum(taken[:, 1:] ** 2, axis=1))),
        drift_white=float(degree),
        drift_slow=drift_slow,
        degree=degree,
        slope=slope,
    )
