"""A time axis that jumps once within a shot, as where a transfer loses samples.

Where it lies is looked for along the shot's own residual; how far it goes is then fitted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LATER = np.array([*np.arange(0.25, 2.0, 0.25), *range(2, 13)])
SHIFTS = np.concatenate((-_LATER[::-1], [0.0], _LATER))
"""Samples by which the record may be late or early, on either side of a jump."""


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
    places = np.arange(signal.size)
    shifted = np.array([np.interp(places + shift, places, signal) for shift in SHIFTS])
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
