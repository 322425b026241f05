"""Limits of a chart of individual values, and what of it is drawn."""

from __future__ import annotations

import numpy as np
import pytest

from impactd.moduli.control_chart import FEWEST, PairChart, trend


def chart(values: np.ndarray) -> PairChart:
    """Return the chart of values of ln E*."""
    size = values.size
    return PairChart(tuple(range(1, size + 1)), ("2026-01-01",) * size, values, np.full(size, 1e-3))


def test_the_limits_are_those_of_the_standard():
    """Mean +- 2.66 mean moving ranges (ISO 7870-2)."""
    values = np.array([1.0, 1.2, 0.9, 1.1, 1.0, 1.3, 0.8, 1.0])
    found = chart(values)
    reach = 2.66 * np.abs(np.diff(values)).mean()
    assert found.limits == pytest.approx((values.mean() - reach, values.mean() + reach), rel=1e-3)


def test_few_shots_have_no_limits():
    """With fewer than eight the limits would mean little, and none are drawn."""
    assert chart(np.zeros(FEWEST - 1)).limits is None
    assert chart(np.zeros(1)).scatter is None


def test_a_drift_does_not_widen_the_limits_that_should_show_it():
    """A slope of twenty scatters over the chart puts its ends outside."""
    noise = np.random.default_rng(3).normal(0.0, 0.001, 100)
    drifting = chart(noise + np.linspace(0.0, 0.02, 100))
    assert {1, 100} <= {drifting.numbers[place] for place in drifting.outside()}
    found = trend(drifting)
    assert found is not None
    assert abs(found["relative"] - 0.02) < 3 * found["u"]


def test_ten_thousand_shots_keep_every_outlier():
    """What is drawn is small, in order, and holds what lies outside."""
    values = np.random.default_rng(4).normal(0.0, 0.001, 10_000)
    values[1234] = 0.5
    found = chart(values)
    places = found.places(1000)
    assert 1234 in places
    assert set(found.outside()) <= set(places)
    assert places == sorted(places)
    assert len(places) < 1200
