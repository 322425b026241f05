r"""Oscillations at one frequency that all shots share, each with its own size and phase.

==============  ====================================================================================
family          columns of a shot
==============  ====================================================================================
``swing``       cos and sin of the time, there before the impact and after it
``clock``       the same times the signal's slope: a time axis that swings
``mode``        a resonance that the signal sets off
==============  ====================================================================================

Two numbers a shot, and a frequency that is looked for along the residual.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.slot_columns import ringing

Array = NDArray[np.float64]

SWINGS_HZ = tuple(np.geomspace(250.0, 20e3, 48).tolist())
CLOCKS_HZ = tuple(np.geomspace(800.0, 40e3, 40).tolist())
MODES_HZ = tuple(np.geomspace(250.0, 60e3, 48).tolist())
MODE_ZETA = 0.05
TUNED = {"swing": SWINGS_HZ, "clock": CLOCKS_HZ, "mode": MODES_HZ}
LARGEST_SHARE = 0.2
"""Frequencies above this share of the sampling rate are left out."""


def tuned_columns(family: str, signal: Array, rate: float, frequency_hz: float) -> Array:
    """Return the two columns of one frequency. Shape (n, 2).

    Parameters
    ----------
    family : str
        A key of `TUNED`.
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    rate, frequency_hz : float
        Sampling rate and frequency. [Hz]

    Returns
    -------
    ndarray, shape (n, 2)
        In phase and out of it.
    """
    if family == "mode":
        return np.column_stack(ringing(signal, rate, frequency_hz, MODE_ZETA))
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
    power = np.zeros(len(grid))
    for signal, residual, rate in zip(signals, residuals, rates, strict=True):
        for at, frequency in enumerate(grid):
            columns = tuned_columns(family, signal, rate, frequency)
            load = columns.T @ residual
            power[at] += load @ np.linalg.lstsq(columns.T @ columns, load, rcond=1e-9)[0]
    return float(grid[int(np.argmax(power))])
