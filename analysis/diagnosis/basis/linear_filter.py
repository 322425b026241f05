"""Linear filters of the signal, and oscillations at one frequency that all shots share.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``response``    a linear, time-invariant chain: delays, slow decays, resonances of the signal
``creep``       memory from tens of microseconds to milliseconds
``slow``        a slow ring that the impact sets off
``impulse``     any linear, time-invariant chain: an impulse response in pieces; only learned
``swing``       cos and sin of the time, there before the impact and after it
``clock``       the same times the signal's slope: a time axis that swings
``mode``        a resonance that the signal sets off
``damped``      the same with its damping looked for as well; only learned
==============  ====================================================================================

The last four have two numbers a shot, its size and phase, and a frequency that is looked for along
the residual. Signals and columns have the unit of the records, columns are of shape (n, q).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.optimize import minimize
from scipy.signal import lfilter

from analysis.aliases import Array

Labelled = tuple[list[str], Array]
"""Labels, and as many columns."""
Crystal = tuple[float, float]
"""Angular frequency [rad/s] and damping ratio [1]."""
_Shot = tuple[Array, Array, float]
"""Signal, residual, sampling rate."""

LARGEST_SHARE = 0.2
"""Of the sampling rate, at a resonance: one needs five samples a period."""
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

MODES_HZ = tuple(np.geomspace(250.0, 60e3, 48).tolist())
TUNED = {
    "swing": tuple(np.geomspace(250.0, 20e3, 48).tolist()),
    "clock": tuple(np.geomspace(800.0, 40e3, 40).tolist()),
    "mode": MODES_HZ,
}
"""Frequencies that are tried, by family. [Hz]"""
DAMPED = "damped"
MODE_ZETA = 0.05
"""Damping ratio of a mode where it is not looked for as well. Chosen by trial."""
ZETAS = (0.01, 0.03, 0.1, 0.3)


def linear_spline(values: Array, knots: Array) -> Array:
    """Return piecewise linear functions, one at each knot and flat beyond. Shape (n, knots)."""
    inside = np.clip(values, knots[0], knots[-1])
    at = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
    share = (inside - knots[at]) / (knots[at + 1] - knots[at])
    found = np.zeros((values.size, knots.size))
    rows = np.arange(values.size)
    found[rows, at] = 1.0 - share
    found[rows, at + 1] = share
    return found


def forgetting(signal: Array, rate: float, tau_s: float) -> Array:
    """Return the signal's mean over the last so many seconds, exponentially forgotten."""
    decay = math.exp(-1 / (rate * tau_s))
    return np.asarray(lfilter([1 - decay], [1, -decay], signal))


def _ringing(signal: Array, rate: float, frequency_hz: float, zeta: float) -> tuple[Array, Array]:
    """Return what a resonance makes of a signal, in phase and out of it."""
    pole = np.exp((-zeta + 1j) * 2 * math.pi * frequency_hz / rate)
    found = lfilter([1 - abs(pole)], [1, -pole], signal)
    return found.real, found.imag


def through_crystal(force: Array, rate: float, crystal: Crystal) -> Array:
    """Return how far a force, over time along axis 0, compresses a crystal; a steady one by itself.

    A force is felt from the next sample on.
    """
    angle, zeta = crystal[0] / rate, crystal[1]
    pole = np.exp((-zeta + 1j * math.sqrt(max(1.0 - zeta**2, 0.0))) * angle)
    turn = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    return np.asarray(lfilter([0.0, sum(turn)], turn, force, axis=0))


def response_columns(signal: Array, rate: float) -> Labelled:
    """Return what a linear, time-invariant chain could add."""
    samples = np.arange(signal.size)
    slope = np.gradient(signal) * rate * 1e-6
    columns = {
        f"lag {lag:g} us": np.interp(samples - lag * 1e-6 * rate, samples, signal, left=0.0)
        for lag in LAGS_US
    }
    columns |= {"slope": slope, "curvature": np.gradient(slope) * rate * 1e-6}
    columns |= {f"decay {t * 1e3:g} ms": forgetting(signal, rate, t) for t in DECAYS_S}
    for frequency in RESONANCES_HZ:
        if frequency > LARGEST_SHARE * rate:
            continue
        both = _ringing(signal, rate, frequency, RESONANCE_ZETA)
        columns |= {
            f"ring {frequency:g} Hz {part}": c for part, c in zip(("cos", "sin"), both, strict=True)
        }
    return list(columns), np.column_stack(list(columns.values()))


def creep_columns(signal: Array, rate: float) -> Labelled:
    """Return the signal's memory over several times."""
    labels = [f"memory {t * 1e3:g} ms" for t in CREEPS_S]
    return labels, np.column_stack([forgetting(signal, rate, t) for t in CREEPS_S])


def slow_columns(signal: Array, rate: float) -> Labelled:
    """Return slow rings that the signal sets off."""
    labels = [f"slow ring {f:g} Hz {part}" for f in SLOW_HZ for part in ("cos", "sin")]
    rings = [c for f in SLOW_HZ for c in _ringing(signal, rate, f, SLOW_ZETA)]
    return labels, np.column_stack(rings)


def impulse_columns(signal: Array, rate: float) -> Labelled:
    """Return an impulse response in pieces, each over the signal."""
    labels, size, pieces = _impulse_pieces(signal.size, rate)
    found = fft.irfft(pieces * fft.rfft(signal, size), size)[:, : signal.size]
    return list(labels), np.asarray(found.T)


@lru_cache(maxsize=8)
def _impulse_pieces(samples: int, rate: float) -> tuple[list[str], int, NDArray[np.complex128]]:
    """Return the pieces' labels and, of so many points, their transforms. Shape (q, frequencies)"""
    knots, step = [0.0], IMPULSE_STEP_US
    while knots[-1] < IMPULSE_UNTIL_US:
        if knots[-1] >= IMPULSE_EVEN_US:
            step = min(step * IMPULSE_GROWTH, IMPULSE_LONGEST_US)
        knots.append(knots[-1] + step)
    lags = np.arange(min(samples, int(knots[-1] * 1e-6 * rate) + 1)) / rate * 1e6
    pieces = linear_spline(lags, np.array(knots))[:, :-1].T
    pieces /= np.maximum(pieces.sum(axis=1, keepdims=True), 1.0)
    size = fft.next_fast_len(samples + lags.size - 1, real=True)
    return [f"{k:.4g} us later" for k in knots[:-1]], size, fft.rfft(pieces, size)


def tuned_columns(
    family: str, signal: Array, rate: float, frequency_hz: float, zeta: float = MODE_ZETA
) -> Array:
    """Return the columns of one frequency, in phase and out of it; zeta damps a resonance."""
    if family in ("mode", DAMPED):
        return np.column_stack(_ringing(signal, rate, frequency_hz, zeta))
    phase = 2 * math.pi * frequency_hz / rate * np.arange(signal.size)
    both = np.column_stack([np.cos(phase), np.sin(phase)])
    if family == "swing":
        return both
    return np.asarray(both * (np.gradient(signal) * rate * 1e-6)[:, None])


def best_frequency(
    family: str, signals: Sequence[Array], residuals: Sequence[Array], rates: Sequence[float]
) -> float:
    """Return the frequency at which two numbers a shot explain most of the residuals. [Hz]

    Noise is taken as white here: it only chooses.
    """
    shots = list(zip(signals, residuals, rates, strict=True))
    grid = _resolved(TUNED[family], rates)
    return float(max(grid, key=lambda f: _power(family, shots, f, MODE_ZETA)))


def _resolved(frequencies_hz: Sequence[float], rates: Sequence[float]) -> Sequence[float]:
    """Return the frequencies that these rates resolve, the lowest where they resolve none."""
    seen = [f for f in frequencies_hz if f < LARGEST_SHARE * min(rates)]
    return seen or [min(*frequencies_hz, LARGEST_SHARE * min(rates))]


def best_damped(
    signals: Sequence[Array], residuals: Sequence[Array], rates: Sequence[float]
) -> tuple[float, float]:
    """Return frequency [Hz] and damping ratio of the resonance that explains most of the residuals.

    From the best of a grid on, also between its points.
    """
    shots = list(zip(signals, residuals, rates, strict=True))
    grid = [(f, zeta) for f in _resolved(MODES_HZ, rates) for zeta in ZETAS]
    first = max(grid, key=lambda place: _power(DAMPED, shots, *place))
    size = max(_power(DAMPED, shots, *first), 1e-300)

    def left(place: Array) -> float:
        """Return how much less is taken up than at the best of the grid."""
        frequency_hz, zeta = np.exp(place)
        return 1.0 - _power(DAMPED, shots, float(frequency_hz), float(zeta)) / size

    bounds = list(zip(np.log(grid[0]).tolist(), np.log(grid[-1]).tolist(), strict=True))
    found = minimize(
        left, np.log(first), method="Nelder-Mead", bounds=bounds,
        options={"xatol": 1e-3, "fatol": 1e-6},
    )  # fmt: skip
    frequency_hz, zeta = np.exp(found.x)
    return float(frequency_hz), float(zeta)


def _power(family: str, shots: Sequence[_Shot], frequency_hz: float, zeta: float) -> float:
    """Return how much of the residuals two numbers a shot explain."""
    power = 0.0
    for signal, residual, rate in shots:
        columns = tuned_columns(family, signal, rate, frequency_hz, zeta)
        load = columns.T @ residual
        power += float(load @ np.linalg.lstsq(columns.T @ columns, load, rcond=1e-9)[0])
    return power
