"""Intervals of shares and medians."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binomtest

from impactd.bench.blind.interval import median, median95, wilson95


@pytest.mark.parametrize(("hits", "count"), [(0, 300), (3, 300), (29, 30), (5, 5), (1, 1)])
def test_a_share_has_wilsons_interval(hits: int, count: int) -> None:
    """It is the one of another implementation, at the ends of the range as well."""
    interval = binomtest(hits, count).proportion_ci(method="wilson")
    assert wilson95(hits, count) == pytest.approx((interval.low, interval.high), abs=1e-6)


def test_the_interval_of_a_median_holds_it_in_95_of_100_samples() -> None:
    """Whatever the distribution: here a lognormal one of 41 values."""
    rng = np.random.default_rng(1)
    held = 0
    for _ in range(1000):
        low, high = median95(list(np.exp(rng.normal(size=41))))
        held += low <= 1.0 <= high
    assert 0.94 <= held / 1000 <= 0.99


def test_a_median_may_be_infinite() -> None:
    """Closures that leave nothing beyond the noise count, too."""
    assert median([1.0, float("inf"), float("inf")]) == float("inf")
