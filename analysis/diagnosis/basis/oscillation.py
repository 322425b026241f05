"""Oscillations at one frequency that all shots share, each with its own size and phase.

==============  ====================================================================================
family          columns of a shot
==============  ====================================================================================
``swing``       cos and sin of the time, there before the impact and after it
``clock``       the same times the signal's slope: a time axis that swings
``mode``        a resonance that the signal sets off
``damped``      the same with its damping looked for as well; only learned
==============  ====================================================================================

Two numbers a shot, and a frequency that is looked for along the residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from analysis.diagnosis.basis.linear_filter import ringing

Array = NDArray[np.float64]

Shot = tuple[Array, Array, float]
"""Signal, residual, sampling rate."""
SWINGS_HZ = tuple(np.geomspace(250.0, 20e3, 48).tolist())
CLOCKS_HZ = tuple(np.geomspace(800.0, 40e3, 40).tolist())
MODES_HZ = tuple(np.geomspace(250.0, 60e3, 48).tolist())
MODE_ZETA = 0.05
"""Damping ratio of a mode where it is not looked for as well. Chosen by trial."""
TUNED = {"swing": SWINGS_HZ, "clock": CLOCKS_HZ, "mode": MODES_HZ}
DAMPED = "damped"
ZETAS = (0.01, 0.03, 0.1, 0.3)
LARGEST_SHARE = 0.2
"""Frequencies above this share of the sampling rate are left out."""


def tuned_columns(
    family: str, signal: Array, rate: float, frequency_hz: float, zeta: float = MODE_ZETA
) -> Array:
    """Return the two columns of one frequency. Shape (n, 2).

    Parameters
    ----------
    family : str
        A key of `TUNED`, or `DAMPED`.
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    rate, frequency_hz : float
        Sampling rate and frequency. [Hz]
    zeta : float
        Damping ratio of a resonance. [1]

    Returns
    -------
    ndarray, shape (n, 2)
        In phase and out of it.
    """
    if family in ("mode", DAMPED):
        return np.column_stack(ringing(signal, rate, frequency_hz, zeta))
    phase = 2 * math.pi * frequency_hz / rate * np.arange(signal.size)
    both = np.column_stack([np.cos(phase), np.sin(phase)])
    if family == "swing":
        return both
    return np.asarray(both * (np.gradient(signal) * rate * 1e-6)[:, None])


def best_frequency(
    family: str, signals: Sequence[Array], residuals: Sequence[Array], rates: Sequence[float]
) -> float:
    """Return the frequency at which two numbers a shot take up most of the residuals.

    Parameters
    ----------
    family : str
        A key of `TUNED`.
    signals, residuals : sequence of ndarray, shape (n_i,)
        The model's signal and what it leaves. [unit of the signal]
    rates : sequence of float
        Sampling rates. [Hz]

    Returns
    -------
    float
        One of the family's grid. [Hz]

    Notes
    -----
    Noise is taken as white here: it only chooses.
    """
    grid = [f for f in TUNED[family] if f < LARGEST_SHARE * min(rates)]
    shots = list(zip(signals, residuals, rates, strict=True))
    power = [_power(family, shots, f, MODE_ZETA) for f in grid]
    return float(grid[int(np.argmax(power))])


def best_damped(
    signals: Sequence[Array], residuals: Sequence[Array], rates: Sequence[float]
) -> tuple[float, float]:
    """Return frequency and damping ratio of the resonance that takes up most of the residuals.

    Parameters
    ----------
    signals, residuals, rates
        As for `best_frequency`.

    Returns
    -------
    frequency_hz, zeta : float
        Within the grids of `MODES_HZ` and `ZETAS` or between their points. [Hz, 1]
    """
    shots = list(zip(signals, residuals, rates, strict=True))
    grid = [(f, zeta) for f in MODES_HZ if f < LARGEST_SHARE * min(rates) for zeta in ZETAS]
    first = max(grid, key=lambda place: _power(DAMPED, shots, *place))
    size = max(_power(DAMPED, shots, *first), 1e-300)
    low, high = np.log(grid[0]), np.log(grid[-1])

    def left(place: Array) -> float:
        """Return how much less is taken up than at the best of the grid."""
        frequency_hz, zeta = np.exp(place)
        return 1.0 - _power(DAMPED, shots, float(frequency_hz), float(zeta)) / size

    found = minimize(
        left,
        np.log(first),
        method="Nelder-Mead",
        bounds=list(zip(low.tolist(), high.tolist(), strict=True)),
        options={"xatol": 1e-3, "fatol": 1e-6},
    )
    frequency_hz, zeta = np.exp(found.x)
    return float(frequency_hz), float(zeta)


def _power(family: str, shots: Sequence[Shot], frequency_hz: float, zeta: float) -> float:
    """Return how much of the residuals two numbers a shot take up."""
    power = 0.0
    for signal, residual, rate in shots:
        columns = tuned_columns(family, signal, rate, frequency_hz, zeta)
        load = columns.T @ residual
        power += float(load @ np.linalg.lstsq(columns.T @ columns, load, rcond=1e-9)[0])
    return power
