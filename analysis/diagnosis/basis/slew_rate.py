"""An output that cannot move faster than so much: an amplifier's slew rate.

The limit is first read off the records, whose steepest stretches have that slope; then fitted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

SLEW = "slew"
STRETCH = 7
"""Samples over which a slope is read off a record."""
STEP = 1e-3
"""Relative change of the limit for its derivative."""


@njit(cache=True)
def _limited(signal: Array, most: float) -> Array:
    found = np.empty_like(signal)
    level = signal[0]
    for i in range(signal.size):
        level += min(max(signal[i] - level, -most), most)
        found[i] = level
    return found


def steepest(records: Sequence[Array], rates: Sequence[float]) -> float:
    """Return the largest slope in some records. [unit of the signal/s]

    Parameters
    ----------
    records : sequence of ndarray, shape (n_i,)
        [unit of the signal]
    rates : sequence of float
        Sampling rates. [Hz]
    """
    place = np.arange(STRETCH) - (STRETCH - 1) / 2.0
    line = place[::-1] / float(place @ place)
    slopes = [
        rate * float(np.max(np.abs(np.convolve(record, line, "valid"))))
        for record, rate in zip(records, rates, strict=True)
    ]
    return max(slopes)


def slope_columns(signal: Array, rate: float, limit_per_s: float) -> tuple[list[str], Array]:
    """Return what a limit of the slope changes, and the change with a tenth more of it.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    rate : float
        Sampling rate. [Hz]
    limit_per_s : float
        Largest slope. [unit of the signal/s]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 2)
        [unit of the signal]
    """
    most = limit_per_s / rate
    slower = _limited(signal, most)
    faster = _limited(signal, most * (1.0 + STEP))
    labels = [f"slope limited to {limit_per_s:.4g} per s", "a tenth more of it"]
    return labels, np.column_stack([slower - signal, 0.1 * (faster - slower) / STEP])
