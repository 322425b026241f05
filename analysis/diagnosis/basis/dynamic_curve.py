"""Curves of the signal with a memory, or of its slope.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``dynamic``     a nonlinearity in the signal's slope
``droop``       a gain that sinks with what the signal has been
``warmth``      a memory of the signal's square and cube; only learned
``slew``        an amplifier's slew rate: no faster than so much; only learned
==============  ====================================================================================

The limit of ``slew`` is first read off the records, whose steepest stretches have that slope; then
fitted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.diagnosis.basis.linear_filter import forgetting
from analysis.diagnosis.basis.scale import Scale

Array = NDArray[np.float64]

DROOPS_S = (2e-4, 1e-3, 5e-3)
WARMTHS_S = (2e-5, 8e-5, 3.2e-4, 1.3e-3, 5e-3)
SLEW = "slew"
STRETCH = 7
"""Samples over which a slope is read off a record."""
STEP = 1e-3
"""Relative change of the limit for its derivative."""


def dynamic_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return what a nonlinearity in the slope could add. Labels and shape (n, q)."""
    slope = np.gradient(signal) * rate * 2e-5 / scale.top
    x = signal / scale.top
    columns = [slope * np.abs(slope), slope**3, x * slope, np.abs(slope) * x]
    return ["slope |slope|", "slope^3", "signal slope", "signal |slope|"], (
        np.column_stack(columns) * scale.top
    )


def droop_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return the signal times its own memory. Labels and shape (n, q)."""
    labels = [f"signal times memory {t * 1e3:g} ms" for t in DROOPS_S]
    columns = [
        signal * forgetting(np.abs(signal), rate, t) * t * rate / (50.0 * scale.top)
        for t in DROOPS_S
    ]
    return labels, np.column_stack(columns)


def warmth_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return the memory of the signal's square and cube. Labels and shape (n, q)."""
    x = signal / scale.top
    labels = [f"memory of {n}, {t * 1e3:g} ms" for n in ("square", "cube") for t in WARMTHS_S]
    columns = [forgetting(scale.top * x**n, rate, t) for n in (2, 3) for t in WARMTHS_S]
    return labels, np.column_stack(columns)


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
