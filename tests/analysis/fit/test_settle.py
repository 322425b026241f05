"""Shots' own parameters with all shared ones held: against the whole normal equations and scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from analysis.fit import joint
from analysis.fit.blocks import linearise_shot, shot_cost
from analysis.fit.problem import JointProblem, build
from analysis.fit.settle import settle
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

BESIDE = np.array([0.01, 0.0, 0.5, 0.0])
"""ln v0, ln e, touch-down [us], baseline [V]."""


@pytest.fixture(params=["kv2", "kv+plastic_yield"])
def fitted(made: tuple[Any, Any], request: pytest.FixtureRequest) -> tuple[JointProblem, Any]:
    """Return a campaign's problem, some steps towards its best."""
    problem, nuisances = with_start(build(made[1], model_named(request.param)))
    return problem, joint.fit(problem, nuisances, max_iterations=3)


def test_equations_of_own_parameters_are_those_within_the_whole(fitted: Any) -> None:
    """The same block of the matrix, the same part of the gradient, the same squares."""
    problem, at = fitted
    item, own = problem.shots[0], at.nuisances[0]
    whole = linearise_shot(problem, item, at.theta, own)
    alone = linearise_shot(problem, item, at.theta, own, own=True)
    assert whole is not None
    assert alone is not None
    s = whole.chain.shape[0]
    scale = np.sqrt(np.diag(alone.matrix))
    units = scale * scale[:, None]
    assert np.allclose(alone.matrix / units, whole.matrix[s:, s:] / units, rtol=0.0, atol=1e-9)
    assert np.allclose(alone.vector / scale, whole.vector[s:] / scale, rtol=1e-9, atol=1e-6)
    assert alone.cost == pytest.approx(whole.cost, rel=1e-12)


def test_each_shot_comes_to_its_own_minimum(fitted: Any) -> None:
    """From 1 % of the speed and half a microsecond beside it; Nelder-Mead finds nothing lower."""
    problem, at = fitted
    found = settle(problem, at.theta, at.nuisances + BESIDE)
    item, own = problem.shots[0], found[0]
    scale = np.array([1e-3, 1e-3, 0.05, 1e-4])
    cost = shot_cost(problem, item, at.theta, own)
    lower = minimize(
        lambda x: shot_cost(problem, item, at.theta, own + scale * x),
        np.zeros(4),
        method="Nelder-Mead",
        options={"maxiter": 800, "xatol": 1e-4, "fatol": 1e-4},
    )
    assert cost - lower.fun < 1e-3 * cost


def test_what_is_kept_does_not_move(fitted: Any) -> None:
    """The speed stays as it was known before, all else follows it."""
    problem, at = fitted
    begun = at.nuisances + BESIDE
    found = settle(problem, at.theta, begun, kept=("ln_v0",))
    assert np.array_equal(found[:, 0], begun[:, 0])
    assert joint.total_cost(problem, at.theta, found) < joint.total_cost(problem, at.theta, begun)
