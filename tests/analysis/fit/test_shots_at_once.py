"""Shots on threads: the order and the numbers do not depend on how many there are."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numba import config

from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.shots_at_once import at_once
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_results_come_in_the_order_of_the_items(
    threads: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each item has its own result, whoever made it."""
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", threads)
    items = list(range(17))
    assert at_once(lambda some: [i * i for i in some], items) == [i * i for i in items]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_thread_that_gives_up_is_seen(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where work stops early there are fewer results than items."""
    monkeypatch.setattr(config, "NUMBA_NUM_THREADS", threads)

    def until_ten(some: Sequence[int]) -> list[int]:
        return [i for i in some if i < 10]

    assert len(at_once(until_ten, list(range(12)))) < 12


def test_a_fit_is_the_same_on_any_number_of_threads(
    made: tuple[object, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Normal equations and cost are equal to the last bit."""
    problem = build(made[1], model_named("kv+stress_relaxation"))  # type: ignore[arg-type]
    nuisances = prepare(problem)
    found = []
    for threads in (1, 2):
        monkeypatch.setattr(config, "NUMBA_NUM_THREADS", threads)
        blocks = joint._linearise_all(problem, problem.start, nuisances)
        assert blocks is not None
        cost = joint._total_cost(problem, problem.start, nuisances, math.inf)
        assert joint._total_cost(problem, problem.start, nuisances, 0.5 * cost) == math.inf
        found.append((np.array([b.matrix for b in blocks]), cost))
    assert np.array_equal(found[0][0], found[1][0])
    assert found[0][1] == found[1][1]
