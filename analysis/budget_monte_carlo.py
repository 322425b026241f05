"""The budget by sampling (JCGM 101): draws of every source through the chain, and whole refits.

Draws go through the joint problem linearised at its solution and from there exactly to every
modulus; each source has its own distribution. Refits cost a joint fit each, and also see what is
not linear in the problem itself: records, statements and speeds are drawn anew and fitted anew.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from analysis.aliases import Array, Json
from analysis.budget import PLANE, YOUNG, Budget, budgets
from analysis.campaign import Quantity, Uncertainty
from analysis.fit import joint
from analysis.fit.fit_shot import FitShot
from analysis.fit.measurand import young_from_plane_strain
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult
from analysis.noise import NoiseModel
from analysis.written_numbers import K_95

FORMAT = "impactd-monte-carlo/1"
LEAST_DRAWS = 100
"""Fewer say nothing of the ends of a 95 % interval."""
BURN_IN = 500
REFIT_STEPS = 12

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Sampled:
    """One modulus as its budget has it, and as draws have it."""

    budget: Budget
    values: Array
    """Draws. Shape (n,). [Pa]"""

    @property
    def relative_u(self) -> float:
        """Return the draws' standard deviation over the value. [1]"""
        return float(self.values.std(ddof=1)) / self.budget.value

    @property
    def interval95(self) -> tuple[float, float]:
        """Return the probabilistically symmetric 95 % interval. [Pa]"""
        low, high = np.quantile(self.values, [0.025, 0.975])
        return float(low), float(high)

    def to_json(self) -> Json:
        """Return both, and how far they are apart."""
        u, value = self.budget.relative_u, self.budget.value
        low, high = self.interval95
        factor = math.exp(K_95 * u)
        return {
            "material": self.budget.name.owner,
            "measurand": self.budget.measurand,
            "value": value,
            "linear": {"u": u * value, "interval95": [value / factor, value * factor]},
            "draws": {"u": self.relative_u * value, "interval95": [low, high]},
            "u_ratio": self.relative_u / u,
            "ends_apart_in_u": [
                (low - value / factor) / (u * value),
                (high - value * factor) / (u * value),
            ],
        }


def draw_of(known: Uncertainty, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Return draws of a source in units of its standard uncertainty (JCGM 101, table 1)."""
    if known.distribution == "rectangular":
        return rng.uniform(-math.sqrt(3), math.sqrt(3), shape)
    if math.isfinite(known.degrees_of_freedom):
        return rng.standard_t(known.degrees_of_freedom, shape)
    return rng.standard_normal(shape)


def monte_carlo(result: FitResult, draws: int, *, seed: int = 0) -> list[Sampled]:
    """Return every modulus by draws through the linearised joint problem.

    They are in the order of `analysis.budget.budgets`. 10^4 draws take a second; fewer than
    `LEAST_DRAWS` are a ValueError. Source: JCGM 101:2008, 7. Validation: against the linear budget
    and against `refits` in ``tests/analysis/test_budget.py``.
    """
    if draws < LEAST_DRAWS:
        raise ValueError(f"{draws} draws say nothing of a 95 % interval; take {LEAST_DRAWS}.")
    rng = np.random.default_rng(seed)
    linear = budgets(result.problem, result.fitted, result.degrees_of_freedom)
    drawn: dict[str, Array] = {}
    found = []
    for budget in linear:
        logs = np.zeros(draws)
        for row in budget.rows:
            source = row.source
            if source.name not in drawn:
                shape = (draws, source.spread.shape[1])
                drawn[source.name] = draw_of(source.uncertainty, shape, rng)
            logs += drawn[source.name] @ row.parts
        found.append(Sampled(budget, budget.value * np.exp(logs)))
    return found


def _noise(model: NoiseModel, samples: int, rng: np.random.Generator) -> Array:
    """Return a record of a noise model. [unit of the signal]"""
    burn = BURN_IN + 4 * model.order
    white = rng.standard_normal(samples + burn) * model.innovation_rms
    return np.asarray(lfilter([1.0], np.r_[1.0, -model.coefficients], white))[burn:]


def _redrawn(result: FitResult, item: FitShot, row: int, rng: np.random.Generator) -> FitShot:
    """Return a shot as it might have been recorded, of the same truth."""
    fit = result.shots[row]
    noise = item.noise
    at = result.problem.item_at(item, result.fitted.theta)
    wrong_by = item.window.signal - at.window.signal
    signal = fit.prediction + wrong_by + _noise(noise, fit.prediction.size, rng)
    shot, speed = item.shot, item.speed_prior
    if shot.restitution is not None and shot.restitution.u > 0:
        u = shot.restitution.u
        told = Quantity(fit.seen_ratio + u * rng.standard_normal(), u)
        shot = dataclasses.replace(shot, restitution=told)
    if speed is not None:
        # the prior moves with g and height offset, so its mean is kept relative to the stated ones
        assert at.speed_prior is not None
        shift = float(fit.own[0]) - at.speed_prior.mean + speed.u * rng.standard_normal()
        speed = dataclasses.replace(speed, mean=speed.mean + shift)
    window = dataclasses.replace(item.window, signal=signal)
    return dataclasses.replace(item, shot=shot, window=window, speed_prior=speed)


def _statements(problem: JointProblem, theta: Array, rng: np.random.Generator) -> Array:
    """Return what might have been stated beforehand, of the same truth."""
    root = np.linalg.cholesky(np.linalg.inv(problem.prior_precision))
    said = theta + root @ rng.standard_normal(theta.size)
    first = theta.size - len(problem.inputs)
    for j, one in enumerate(problem.inputs, start=first):
        said[j] = theta[j] + one.u * float(draw_of(one.uncertainty, (1,), rng)[0])
    # where nothing was known there is nothing to state: those stay where the fit found them
    weak = np.diag(problem.prior_precision) < 1.0
    said[weak] = theta[weak]
    return said


def refits(
    result: FitResult, count: int, *, seed: int = 0, progress: Progress | None = None
) -> list[Sampled]:
    """Return every modulus by whole joint fits of records and statements drawn anew.

    ``result``, a joint fit with moduli, is taken for the truth. Fits that do not converge are left
    out. The moduli are in the order of `analysis.budget.budgets`.
    """
    problem, fitted = result.problem, result.fitted
    rng = np.random.default_rng(seed)
    linear = budgets(problem, fitted, result.degrees_of_freedom)
    values: list[list[float]] = []
    for done in range(count):
        said = _statements(problem, fitted.theta, rng)
        shots = [_redrawn(result, item, i, rng) for i, item in enumerate(problem.shots)]
        again = dataclasses.replace(problem, shots=shots, prior_mean=said)
        found = joint.fit(again, fitted.nuisances, theta=fitted.theta, max_iterations=REFIT_STEPS)
        if found.converged:
            values.append([_modulus(again, found, b, rng) for b in linear])
        if progress is not None:
            progress("refit", (done + 1) / count)
    columns = np.array(values).T
    return [Sampled(b, v) for b, v in zip(linear, columns, strict=True)]


def _modulus(
    problem: JointProblem, fitted: joint.Fitted, budget: Budget, rng: np.random.Generator
) -> float:
    j = problem.names.index(budget.name)
    log, u = float(fitted.theta[j]), math.sqrt(float(fitted.covariance[j, j]))
    if budget.measurand == PLANE:
        return math.exp(log)
    assert budget.measurand == YOUNG
    campaign, name = problem.campaign, budget.name
    material = (campaign.spheres if name.kind == "sphere" else campaign.surfaces)[name.owner]
    ratio = material.poissons_ratio
    assert ratio is not None
    if material.youngs_modulus_pa is not None:
        # the statement of E' was drawn as one, so its share in E is not to be told: the mean form
        return young_from_plane_strain(log, u, material.youngs_modulus_pa, ratio)[0]
    drawn = Quantity(min(ratio.value + ratio.u * rng.standard_normal(), 0.5), ratio.u)
    return young_from_plane_strain(log, u, None, drawn)[0]
