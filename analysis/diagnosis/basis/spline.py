"""Piecewise linear functions over knots."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def bumps(t: Array, knots: Array, size: float) -> Array:
    """Return piecewise linear bumps over knots, the outer two of which only end the last bumps."""
    at = np.searchsorted(knots, t, side="right") - 1
    inside = (at >= 0) & (at < knots.size - 1)
    rows, left = np.flatnonzero(inside), at[inside]
    share = (t[inside] - knots[left]) / (knots[left + 1] - knots[left])
    whole = np.zeros((t.size, knots.size))
    whole[rows, left] = size * (1.0 - share)
    whole[rows, left + 1] = size * share
    return whole[:, 1:-1]


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
