"""Shots on all cores: the same result to the last bit, and errors that come through."""

from __future__ import annotations

import threading
import warnings
from typing import Any

import numpy as np
import pytest

from analysis.fit import joint, over_shots
from analysis.fit.over_shots import for_each_shot
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

pytestmark = pytest.mark.usefixtures("four_cores")


@pytest.fixture
def four_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """Work as on four cores, whatever the machine has."""
    monkeypatch.setattr(over_shots, "CORES", 4)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 18, 55])
@pytest.mark.parametrize("on_all_cores", [True, False])
def test_results_come_in_the_order_of_shots(count: int, on_all_cores: bool) -> None:
    """However many threads share them."""
    found = for_each_shot(lambda i: i * i, count, on_all_cores=on_all_cores)
    assert found == [i * i for i in range(count)]


def test_several_threads_take_part_and_all_have_ended() -> None:
    """Four that wait for one another, so that one alone would not come to an end."""
    before, meet = threading.active_count(), threading.Barrier(4, timeout=60)
    for_each_shot(lambda i: meet.wait() if i < 4 else 0, 16, on_all_cores=True)
    assert threading.active_count() == before


def test_what_a_shot_raises_comes_through() -> None:
    """As where the time is over."""
    with pytest.raises(ZeroDivisionError):
        for_each_shot(lambda i: 1 // (i - 13), 54, on_all_cores=True)


def test_numpy_keeps_silent_where_it_was_told_to() -> None:
    """The caller's error state holds in every thread."""
    with warnings.catch_warnings(), np.errstate(over="ignore"):
        warnings.simplefilter("error")
        found = for_each_shot(lambda _: float(np.exp(np.float64(1e4))), 16, on_all_cores=True)
    assert found == [np.inf] * 16


def test_a_fit_is_the_same_to_the_last_bit(
    made: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With a compiled law of an effect, on four cores and on one."""
    problem, nuisances = with_start(build(made[1], model_named("kv+plastic_yield")))
    on_four = joint.fit(problem, nuisances, max_iterations=3)
    monkeypatch.setattr(over_shots, "CORES", 1)
    on_one = joint.fit(problem, nuisances, max_iterations=3)
    assert np.array_equal(on_four.theta, on_one.theta)
    assert on_four.cost == on_one.cost
