"""Decimation of a long record for drawing: minima and maxima are kept."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MAX_POINTS = 4000


def min_max_indices(signal: NDArray[np.float64], points: int) -> NDArray[np.intp]:
    """Return which samples of a signal, shape (n,), to draw so that no spike is lost.

    They rise, and are at most ``points`` (>= 2): all when the record is short enough. Else the
    record is cut into ``points // 2`` stretches of equal length (the last one takes the rest of the
    division); of each, the smallest and the largest sample stay, in their order in time.
    """
    if signal.size <= points:
        return np.arange(signal.size)
    stretches = points // 2
    length = -(-signal.size // stretches)
    whole = signal.size // length * length
    rows = signal[:whole].reshape(-1, length)
    starts = np.arange(rows.shape[0]) * length
    kept = np.stack([starts + rows.argmin(axis=1), starts + rows.argmax(axis=1)])
    rest = signal[whole:]
    if rest.size:
        tail = np.array([[whole + rest.argmin()], [whole + rest.argmax()]])
        kept = np.concatenate([kept, tail], axis=1)
    return np.sort(kept, axis=None)
