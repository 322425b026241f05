"""Profile likelihoods against a minimiser that shares nothing with the joint fit."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import least_squares

from analysis import fit_campaign
from analysis.fit.blocks import prior_rows
from analysis.fit.profile import LEVEL95, cost_held_at, profile
from analysis.fit.result import FitResult
from analysis.fit.steps import along, step_towards


@pytest.fixture(scope="module")
def two_shots(truth: Any) -> FitResult:
    """Return a fit of two drops of one pair, the specimen's modulus free."""
    rig = truth(seed=31)
    return fit_campaign(
        rig.campaign(pairs=(("acetal", "specimen"),), heights_m=(0.02, 0.05)), "kv", heldout=False
    )


def _brute_force(fit: FitResult, name: str, x: float) -> float:
    """Return the least cost with one global taken out, by scipy and finite differences."""
    problem, fitted = fit.problem, fit.fitted
    j = problem.names.index(name)
    root = np.linalg.cholesky(problem.prior_precision).T
    size = len(problem.names)

    def residuals(free: Any) -> Any:
        free = free * scale + centre
        theta = np.insert(free[: size - 1], j, x)
        found = [root @ (theta - problem.prior_mean)]
        for i, item in enumerate(problem.shots):
            own = free[size - 1 + 4 * i : size + 3 + 4 * i]
            local = np.concatenate([problem.shared_local(item, theta)[0], own])
            p = problem.model.predict(local, item.frame)
            found.append(item.noise.whiten(p.signal - item.window.signal))
            extra, _ = prior_rows(problem.model, item, local, p.rebound_ratio, np.zeros(local.size))
            found.append(np.array(extra))
        return np.concatenate(found)

    centre = np.concatenate([np.delete(fitted.theta, j), fitted.nuisances.ravel()])
    u = [np.sqrt(np.diag(s.nuisance_covariance)) for s in fit.shots]
    scale = np.concatenate([np.delete(np.sqrt(np.diag(fitted.covariance)), j), *u])
    found = least_squares(
        residuals, np.zeros(centre.size), method="lm", diff_step=1e-4, xtol=1e-10, ftol=1e-12
    )
    return float(2 * found.cost)


@pytest.mark.parametrize("name", ["sensor.ln_S", "sensor.ln_M", "surface.specimen", "sensor.ln_w"])
@pytest.mark.parametrize("side", [-2.0, 1.5])
def test_profile_is_the_brute_force_one(two_shots: FitResult, name: str, side: float) -> None:
    """Holding a parameter off its best costs what an independent minimiser finds."""
    problem, fitted = two_shots.problem, two_shots.fitted
    j = problem.names.index(name)
    x = float(fitted.theta[j]) + side * math.sqrt(fitted.covariance[j, j])
    cost, found = cost_held_at(problem, fitted, name, x)
    assert found.theta[j] == pytest.approx(x, abs=1e-6 * math.sqrt(fitted.covariance[j, j]))
    assert cost == pytest.approx(_brute_force(two_shots, name, x), abs=0.02)
    assert cost - fitted.cost == pytest.approx(side**2, rel=0.15)


def test_interval_ends_lie_on_the_level(two_shots: FitResult) -> None:
    """The cost at both ends of the interval has risen by 3.84, and lies between on the way."""
    found = profile(two_shots.problem, two_shots.fitted, "surface.specimen")
    assert found.low is not None
    assert found.high is not None
    for end in (found.low, found.high):
        cost, _ = cost_held_at(two_shots.problem, two_shots.fitted, "surface.specimen", end)
        assert cost - two_shots.fitted.cost == pytest.approx(LEVEL95, rel=0.03)
    assert (np.diff(found.at) > 0).all()
    assert found.rise.min() == 0.0


def test_lopsided_likelihood_gives_a_lopsided_interval(truth: Any) -> None:
    """With both moduli of one pair open, each has a lower bound and hardly an upper one."""
    rig = truth(seed=32)
    campaign = rig.campaign(
        pairs=(("acetal", "specimen"),), heights_m=(0.02, 0.05), unknown=("specimen", "acetal")
    )
    fit = fit_campaign(campaign, "kv", heldout=False)
    found = profile(fit.problem, fit.fitted, "sphere.acetal")
    j = fit.problem.names.index("sphere.acetal")
    best = float(fit.fitted.theta[j])
    assert found.low is not None
    assert best - found.low < 1.0
    assert found.high is None or found.high - best > 5 * (best - found.low)
    # E' of the sphere cannot be below the pair's E*
    shot = fit.shots[0]
    reduced = fit.pair_modulus(shot.item)
    assert reduced is not None
    assert reduced[0] < found.low < reduced[0] + 0.2


@pytest.mark.parametrize("distance", [-2.0, -0.3, 0.1, 0.6, 3.0])
def test_steps_arrive(two_shots: FitResult, distance: float) -> None:
    """The step made for a distance leads that far, for moduli and for everything else."""
    problem, theta = two_shots.problem, two_shots.fitted.theta
    for j, name in enumerate(problem.names):
        step = np.zeros(theta.size)
        step[j] = step_towards(name, distance)
        assert along(problem, theta, step)[j] - theta[j] == pytest.approx(distance, rel=1e-9)
