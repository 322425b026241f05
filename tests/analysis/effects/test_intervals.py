"""Intervals of effects' numbers: those of positive quantities are positive."""

from __future__ import annotations

import math

import pytest

from analysis.effects.library import library


def _parameters():
    return [
        pytest.param(parameter, id=f"{form.id}.{parameter.name}")
        for effect in library().values()
        for form in (effect, *effect.variants)
        for parameter in form.parameters
    ]


@pytest.mark.parametrize("parameter", _parameters())
@pytest.mark.parametrize("reach", [0.01, 0.5, 3.0, 900.0])
def test_no_positive_quantity_reaches_below_nothing(parameter, reach):
    """However little is known of a number that cannot be negative, its interval is not either."""
    start = parameter.starts[0] if parameter.starts else parameter.scale
    at = parameter.coordinate(start)
    low, high = parameter.interval(at, reach)
    assert low <= start * (1 + 1e-12)
    assert start <= high * (1 + 1e-12)
    if parameter.low >= 0.0:
        assert low >= 0.0


def test_a_logarithm_s_interval_is_that_of_its_coordinate():
    """A damping known to a factor has the interval of that factor, and not one about zero."""
    (damping,) = [
        p for p in library()["adhesive_layer"].parameters if p.name == "damping_n_s_per_m"
    ]
    low, high = damping.interval(math.log(89.0), 2.0)
    assert (low, high) == pytest.approx((89.0 * math.exp(-2.0), 89.0 * math.exp(2.0)))


def test_what_may_be_as_large_as_it_likes_has_an_open_interval():
    """A time constant whose inverse may be nothing has a lower end only."""
    (constant,) = library()["coupler_highpass"].parameters
    at = constant.coordinate(constant.scale)
    low, high = constant.interval(at, 2 * at)
    assert low == pytest.approx(constant.scale / 3)
    assert high == math.inf
