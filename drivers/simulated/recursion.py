"""A first-order recursion, compiled: the only filter that the simulator needs.

``scipy.signal`` would do the same and takes a second of every start of the daemon to import.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


def run_on(drive: NDArray[Any], keep: complex, last: complex) -> NDArray[Any]:
    """Return ``y[n] = drive[n] + keep y[n - 1]``, with ``last`` before the first.

    All are float, or all complex.
    """
    return _run_on(drive, drive.dtype.type(keep), drive.dtype.type(last))


@njit(cache=True)
def _run_on(drive: NDArray[Any], keep: Any, last: Any) -> NDArray[Any]:
    result = np.empty_like(drive)
    for i in range(drive.size):
        last = drive[i] + keep * last
        result[i] = last
    return result
