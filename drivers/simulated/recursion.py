"""A first-order recursion, compiled: the only filter that the simulator needs.

``scipy.signal`` would do the same and takes a second of every start of the daemon to import.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


def run_on(drive: NDArray[Any], keep: complex, last: complex) -> NDArray[Any]:
    """Return ``y[n] = drive[n] + keep y[n - 1]``.

    Parameters
    ----------
    drive : ndarray of float64 or complex128, shape (n,)
        What comes in.
    keep : float or complex
        What is kept of one value in the next; of the kind of ``drive``. [1]
    last : float or complex
        The value before the first one; of the kind of ``drive``.

    Returns
    -------
    ndarray, shape (n,)
        Of the kind and unit of ``drive``.
    """
    return _run_on(drive, drive.dtype.type(keep), drive.dtype.type(last))


@njit(cache=True)
def _run_on(drive: NDArray[Any], keep: Any, last: Any) -> NDArray[Any]:
    result = np.empty_like(drive)
    for i in range(drive.size):
        last = drive[i] + keep * last
        result[i] = last
    return result
