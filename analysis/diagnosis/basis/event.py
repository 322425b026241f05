"""What happens once in a shot, at a time of its own.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``jump``        a time axis that jumps, as where a transfer loses samples; only learned
``blow``        a late impact: a second bell of force, read through the crystal; only learned
==============  ====================================================================================

When it comes is looked for along the shot's own residual; how far or how large is then fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.signal import correlate

from analysis.diagnosis.basis.contact_force import Crystal, through_crystal

Array = NDArray[np.float64]

_LATER = np.array([*np.arange(0.25, 2.0, 0.25), *range(2, 13)])
SHIFTS = np.concatenate((-_LATER[::-1], [0.0], _LATER))
"""Samples by which the record may be late or early, on either side of a jump."""
LATE_IMPACT = "blow"
WIDTHS_US = tuple((12.0 * 2.0 ** np.arange(0.0, 6.5, 0.125)).tolist())
RING_US = 600.0
"""How long after its own end a late impact is felt."""
EARLY_US = 1.0
"""By so much a coefficient of one moves a late impact of the size of one."""


def jump_columns(signal: Array, residual: Array, first: int) -> tuple[list[str], Array]:
    """Return what a shot's best jump adds, for one sample of it.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    residual : ndarray, shape (n,)
        What it leaves of the record. [unit of the signal]
    first : int
        First sample at which the jump may lie, the one of touch-down.

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 1)
        Its coefficient says how far the clock jumps, whichever jump was the best so far.
        [unit of the signal]
    """
    places, whole = np.arange(signal.size), np.floor(SHIFTS).astype(np.intp)
    most = int(np.abs(whole).max()) + 1
    later = sliding_window_view(np.pad(signal, most, mode="edge"), signal.size)
    near = later[most + whole]
    shifted = near + (SHIFTS - whole)[:, None] * (later[most + whole + 1] - near)
    added = shifted - signal
    fall = added * (2.0 * residual - added)
    until = np.cumsum(fall, axis=1) - fall
    since = fall.sum(axis=1, keepdims=True) - until
    before, after = until.argmax(axis=0), since.argmax(axis=0)
    both = until[before, places] + since[after, places]
    at = first + int(np.argmax(both[first:]))
    lost = float(SHIFTS[after[at]] - SHIFTS[before[at]])
    if lost == 0.0:
        return ["samples lost"], np.zeros((signal.size, 1))
    column = (shifted[after[at]] - shifted[before[at]]) * (places >= at) * (1.0 / lost)
    return ["samples lost"], column[:, None]


def late_impact_shape(width_us: float, rate: float, crystal: Crystal | None) -> Array:
    """Return what the cell reads of a bell of force whose greatest is one. Shape (n,).

    Parameters
    ----------
    width_us : float
        From beginning to end. [us]
    rate : float
        Sampling rate. [Hz]
    crystal : tuple or None
        Through whose resonance it is read; None for a rigid cell.

    Returns
    -------
    ndarray, shape (n,)
        From the sample at which it begins. [1]
    """
    long = max(int(width_us * 1e-6 * rate), 3)
    force = np.zeros(long + int(RING_US * 1e-6 * rate))
    force[:long] = 0.5 - 0.5 * np.cos(2.0 * math.pi * (np.arange(long) + 0.5) / long)
    if crystal is None:
        return force
    return through_crystal(force, rate, crystal)


def _place(residual: Array, shape: Array, first: int) -> tuple[int, float]:
    """Return where a shape takes up most of a residual, and how much."""
    room = residual.size - first
    if room < 2:
        return first, 0.0
    heard = correlate(np.append(residual[first:], np.zeros(shape.size)), shape, "valid")[:room]
    power = np.cumsum(np.square(shape))
    seen = power[np.minimum(room - np.arange(room), shape.size) - 1]
    # what is cut off by the end of the record is no late impact yet
    fall = np.where(seen > 0.5 * power[-1], np.square(heard) / np.maximum(seen, 1e-300), 0.0)
    at = int(np.argmax(fall))
    return first + at, float(fall[at])


def late_impact_width(
    residuals: Sequence[Array], firsts: Sequence[int], rates: Sequence[float],
    crystals: Sequence[Crystal | None],
) -> float:  # fmt: skip
    """Return the width at which one late impact a shot takes up most of the residuals.

    Parameters
    ----------
    residuals : sequence of ndarray, shape (n_i,)
        What the model leaves. [unit of the signal]
    firsts : sequence of int
        First sample of each at which a late impact may begin.
    rates : sequence of float
        Sampling rates. [Hz]
    crystals : sequence
        As `late_impact_shape` takes them.

    Returns
    -------
    float
        One of `WIDTHS_US`. [us]

    Notes
    -----
    Noise is taken as white here: it only chooses.
    """
    readers = list(zip(rates, crystals, strict=True))
    falls = []
    for width in WIDTHS_US:
        shapes = {reader: late_impact_shape(width, *reader) for reader in set(readers)}
        places = zip(residuals, firsts, readers, strict=True)
        falls.append(sum(_place(r, shapes[reader], first)[1] for r, first, reader in places))
    return float(WIDTHS_US[int(np.argmax(falls))])


def late_impact_columns(
    residual: Array, first: int, rate: float, shape: Array, size: float
) -> tuple[list[str], Array]:
    """Return what a shot's best late impact adds, and what it adds when it comes a little earlier.

    Parameters
    ----------
    residual : ndarray, shape (n,)
        What the model leaves of the record. [unit of the signal]
    first : int
        First sample at which a late impact may begin.
    rate : float
        Sampling rate. [Hz]
    shape : ndarray, shape (m,)
        From `late_impact_shape`.
    size : float
        Of the late impact at a coefficient of one. [unit of the signal]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 2)
        [unit of the signal]
    """
    at, _ = _place(residual, shape, first)
    column = np.zeros(residual.size)
    seen = min(shape.size, residual.size - at)
    column[at : at + seen] = size * shape[:seen]
    earlier = np.gradient(column) * rate * 1e-6 * EARLY_US
    return ["a blow over the pulse", "earlier"], np.column_stack([column, earlier])
