"""Linear filters of the signal: lags, decays, memory, resonances.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``response``    a linear, time-invariant chain: delays, slow decays, resonances of the signal
``creep``       memory from tens of microseconds to milliseconds
``slow``        a slow ring that the impact sets off
``impulse``     any linear, time-invariant chain: an impulse response in pieces; only learned
==============  ====================================================================================
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.spline import linear_spline

Array = NDArray[np.float64]

LAGS_US = (2.0, 4.0, 6.0, 9.0, 13.0, 18.0, 25.0, 35.0, 48.0, 64.0)
DECAYS_S = (0.2e-3, 0.6e-3, 2e-3, 8e-3)
RESONANCES_HZ = (1.5e3, 3e3, 6e3, 10e3, 24e3, 34e3, 50e3, 80e3)
RESONANCE_ZETA = 0.04
"""Damping ratio of them all. Chosen by trial."""
CREEPS_S = (2e-5, 8e-5, 3.2e-4, 1.3e-3, 5e-3)
SLOW_HZ = (300.0, 600.0, 1200.0, 2400.0)
SLOW_ZETA = 0.1
"""Damping ratio of them all. Chosen by trial."""
# knots of an impulse response: even ones first, then wider and wider apart, up to the longest
IMPULSE_STEP_US, IMPULSE_EVEN_US, IMPULSE_GROWTH, IMPULSE_UNTIL_US = 2.0, 20.0, 1.1, 1500.0
IMPULSE_LONGEST_US = 12.0
"""Widest step between two of them."""


def forgetting(signal: Array, rate: float, tau_s: float) -> Array:
    """Return the signal's mean over the last so many seconds, exponentially forgotten."""
    decay = math.exp(-1 / (rate * tau_s))
    return np.asarray(lfilter([1 - decay], [1, -decay], signal))


def ringing(signal: Array, rate: float, frequency_hz: float, zeta: float) -> tuple[Array, Array]:
    """Return what a resonance makes of a signal, in phase and out of it."""
    pole = np.exp((-zeta + 1j) * 2 * math.pi * frequency_hz / rate)
    found = lfilter([1 - abs(pole)], [1, -pole], signal)
    return found.real, found.imag


def _delayed(signal: Array, samples: float) -> Array:
    """Return the signal later by a number of samples, at rest before."""
    at = np.arange(signal.size) - samples
    return np.asarray(np.interp(at, np.arange(signal.size), signal, left=0.0))


def response_columns(signal: Array, rate: float) -> tuple[list[str], Array]:
    """Return what a linear, time-invariant chain could add. Labels and shape (n, q)."""
    labels, columns = [], []
    for lag in LAGS_US:
        labels.append(f"lag {lag:g} us")
        columns.append(_delayed(signal, lag * 1e-6 * rate))
    slope = np.gradient(signal) * rate * 1e-6
    labels += ["slope", "curvature"]
    columns += [slope, np.gradient(slope) * rate * 1e-6]
    for tau in DECAYS_S:
        decay = math.exp(-1 / (rate * tau))
        labels.append(f"decay {tau * 1e3:g} ms")
        columns.append(lfilter([1 - decay], [1, -decay], signal))
    for frequency in RESONANCES_HZ:
        if frequency > 0.2 * rate:
            continue
        pole = np.exp((-RESONANCE_ZETA + 1j) * 2 * math.pi * frequency / rate)
        ringing = lfilter([1 - abs(pole)], [1, -pole], signal)
        labels += [f"ring {frequency:g} Hz cos", f"ring {frequency:g} Hz sin"]
        columns += [ringing.real, ringing.imag]
    return labels, np.column_stack(columns)


def creep_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return the signal's memory over several times. Labels and shape (n, q)."""
    del scale
    labels = [f"memory {t * 1e3:g} ms" for t in CREEPS_S]
    return labels, np.column_stack([forgetting(signal, rate, t) for t in CREEPS_S])


def slow_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return slow rings that the signal sets off. Labels and shape (n, q)."""
    del scale
    labels = [f"slow ring {f:g} Hz {p}" for f in SLOW_HZ for p in ("cos", "sin")]
    return labels, np.column_stack(
        [c for f in SLOW_HZ for c in ringing(signal, rate, f, SLOW_ZETA)]
    )


def impulse_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return an impulse response in pieces, each over the signal. Labels and shape (n, q)."""
    del scale
    most = math.ceil((IMPULSE_UNTIL_US + IMPULSE_LONGEST_US) * 1e-6 * rate) + 1
    labels, pieces = _impulse_pieces(min(signal.size, most), rate)
    return list(labels), _over(signal, pieces).T


@lru_cache(maxsize=8)
def _impulse_pieces(samples: int, rate: float) -> tuple[list[str], Array]:
    """Return the pieces by their lags. Labels and shape (q, lags)."""
    knots, step = [0.0], IMPULSE_STEP_US
    while knots[-1] < IMPULSE_UNTIL_US:
        if knots[-1] >= IMPULSE_EVEN_US:
            step = min(step * IMPULSE_GROWTH, IMPULSE_LONGEST_US)
        knots.append(knots[-1] + step)
    lags = np.arange(min(samples, int(knots[-1] * 1e-6 * rate) + 1)) / rate * 1e6
    pieces = linear_spline(lags, np.array(knots))[:, :-1]
    pieces /= np.maximum(pieces.sum(axis=0), 1.0)
    return [f"{k:.4g} us later" for k in knots[:-1]], np.ascontiguousarray(pieces.T)


@njit(cache=True, nogil=True)
def _over(signal: Array, pieces: Array) -> Array:
    """Return each piece over the signal; few lags of a piece are not zero. Shape (q, n)."""
    found = np.zeros((pieces.shape[0], signal.size))
    for row in range(pieces.shape[0]):
        for lag in range(pieces.shape[1]):
            weight = pieces[row, lag]
            if weight != 0.0:
                for i in range(signal.size - lag):
                    found[row, lag + i] += weight * signal[i]
    return found
