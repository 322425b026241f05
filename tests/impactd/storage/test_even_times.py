"""Times that an export rounded are even; times with a gap or jitter are not."""

from __future__ import annotations

import numpy as np
import pytest

from impactd.storage.even_times import UnevenTimesError, find_rate


@pytest.mark.parametrize("rate", [25_600.0, 44_100.0, 51_200.0, 1e6])
@pytest.mark.parametrize("start", [0.0, -0.0123, 3.7])
@pytest.mark.parametrize("printed", [np.round, np.floor])
def test_a_rate_is_found_in_rounded_times(rate: float, start: float, printed: np.ufunc) -> None:
    """Steps of 10 us, rounded or cut: the truth lies within four of the stated uncertainty."""
    times = printed((start + np.arange(4000) / rate) * 1e5) / 1e5
    found = find_rate(times)
    assert abs(found.rate - rate) <= max(4 * found.u_rate, 1e-9 * rate)
    assert found.u_rate < 0.01 * rate


def test_times_that_are_printed_finely_are_exact() -> None:
    """No uncertainty is made up for them."""
    found = find_rate(np.arange(1000) * 5e-6)
    assert found.rate == pytest.approx(200_000.0, rel=1e-12)
    assert found.u_rate == 0.0
    assert found.grid is None


@pytest.mark.parametrize(
    "times",
    [
        np.array([0.0, 1e-6, 5e-6, 6e-6]),
        np.delete(np.arange(5000) * 1e-5, 2500),
        np.arange(1000) * 1e-5 + np.random.default_rng(1).uniform(0, 3e-6, 1000).round(7),
        np.arange(10)[::-1] * 1.0,
        np.zeros(5),
    ],
)
def test_gaps_and_jitter_are_refused(times: np.ndarray) -> None:
    """What rounding cannot explain is no even sampling."""
    with pytest.raises(UnevenTimesError):
        find_rate(times)
