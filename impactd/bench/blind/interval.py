"""Intervals for shares and medians of few trials."""

from __future__ import annotations

import math
from collections.abc import Sequence

from scipy.stats import binom

Z95 = 1.959964


def wilson95(hits: int, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share.

    Parameters
    ----------
    hits, count : int
        Cases and trials, 0 <= hits <= count, count > 0.

    Returns
    -------
    low, high : float
        Wilson's score interval (Wilson 1927), which also holds where no case or each is one. [1]
    """
    share, z2 = hits / count, Z95 * Z95
    centre = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = Z95 * math.sqrt(share * (1 - share) / count + z2 / (4 * count**2)) / (1 + z2 / count)
    return max(centre - half, 0.0), min(centre + half, 1.0)


def median95(values: Sequence[float]) -> tuple[float, float]:
    """Return the 95 % interval of a median, whatever the distribution.

    Parameters
    ----------
    values : sequence of float
        At least one.

    Returns
    -------
    low, high : float
        Two order statistics, by the binomial distribution of how many lie below the median; the
        smallest and the largest where there are fewer than six values.
    """
    ranked = sorted(values)
    below = int(binom.ppf(0.025, len(ranked), 0.5))
    at = max(below - 1, 0)
    return ranked[at], ranked[len(ranked) - 1 - at]


def median(values: Sequence[float]) -> float:
    """Return the middle value, which may be infinite.

    Parameters
    ----------
    values : sequence of float
        At least one.

    Returns
    -------
    float
        The upper one of two.
    """
    ranked = sorted(values)
    return ranked[len(ranked) // 2]
