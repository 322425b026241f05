r"""The marginal likelihood of a model, by which models are compared.

.. math:: Z = \int e^{-C(\theta) / 2} p(\theta)\, d\theta

with C the whitened squares and p the priors' density. Laplace's approximation takes the posterior
as a Gaussian with the normal matrix H of the fit:

.. math:: \ln Z = -\frac{C}{2} + \ln p + \frac{d}{2} \ln 2 \pi - \frac{1}{2} \ln |H|

Source: D. J. C. MacKay, Information Theory, Inference and Learning Algorithms, 2003, chapter 28.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.basis.groupings import price_of_grouping
from analysis.effects.effect import Effect, EffectParameter
from analysis.fit import joint
from analysis.fit.problem import JointProblem
from analysis.fit.stated_effects import effect_prior
from analysis.parameters import ParameterName

UNIFORM_VARIANCE = 1.0 / 12.0
"""Variance of a uniform density of width 1: no posterior is wider than its prior."""
LEAST_EIGENVALUE = 1e-12
"""Of a matrix with ones along its diagonal; below is rounding."""
LN_2_PI = math.log(2.0 * math.pi)


def log_integral(problem: JointProblem, fitted: joint.Fitted) -> float:
    r"""Return Laplace's approximation of :math:`\ln \int e^{-C/2}` over all parameters.

    The fit is at the minimum of C, which holds the squares of what priors there are, without their
    normalisation; globals and the shots' own parameters are integrated over.
    """
    size = fitted.theta.size + fitted.nuisances.size
    shared, _, _ = joint.normal_equations(problem, fitted)
    shots = sum(log_det(b.matrix[b.chain.shape[0] :, b.chain.shape[0] :]) for b in fitted.blocks)
    return 0.5 * (size * LN_2_PI - fitted.cost - (log_det(shared) + shots))


def log_det(matrix: Array) -> float:
    """Return ln|H|; a direction that the data leave open counts for as little in every model."""
    seen = np.diag(matrix) > 0.0
    scale = np.sqrt(np.diag(matrix)[seen])
    values = np.zeros(seen.size)
    values[seen] = np.linalg.eigvalsh(matrix[np.ix_(seen, seen)] / np.outer(scale, scale))
    return float(2.0 * np.log(scale).sum() + np.log(np.maximum(values, LEAST_EIGENVALUE)).sum())


@dataclasses.dataclass(frozen=True)
class Price:
    """What the volume of a model's parameters takes off its likelihood, in whitened squares."""

    shared: float = 0.0
    """Of the globals: twice ln(prior volume / posterior volume)."""
    shots: float = 0.0
    """Of the shots' speed, restitution, touch-down and baseline, which an effect makes less certain
    or more."""
    grouping: float = 0.0
    """Of the choice of the materials that it acts on, minus twice the logarithm of its prior."""


def price_of_effect(
    problem: JointProblem, fitted: joint.Fitted, base: joint.Fitted, effect: Effect
) -> Price:
    r"""Return by how much an effect's likelihood ratio exceeds its ratio of evidences.

    So that :math:`2 \Delta \ln Z = \Delta C - price`. The effect was added last; ``base`` is the
    fit without it, of the same shots. Numbers that the effect has in every shot are not in the
    price. The prior of a number is uniform in its coordinate between its physical limits; where a
    campaign states the number, it is Gaussian.
    """
    # of an effect that another has been added to, the numbers are not the last ones
    mine = [j for j, name in enumerate(problem.names) if name.is_of(effect.id)]
    rest = [j for j in range(len(problem.names)) if j not in mine]
    without = dataclasses.replace(
        problem,
        names=[problem.names[j] for j in rest],
        prior_mean=problem.prior_mean[rest],
        prior_precision=problem.prior_precision[np.ix_(rest, rest)],
    )
    after, _, _ = joint.normal_equations(problem, fitted)
    before, _, _ = joint.normal_equations(without, base)
    volume = 0.0
    for j in mine:
        width = _prior_width(problem, problem.names[j], effect)
        after[j, j] += 1.0 / (UNIFORM_VARIANCE * width**2)
        volume += 2.0 * math.log(width) - LN_2_PI
    own = _places_in_shot(problem, effect)
    shots = sum(
        _conditional_log_det(new.matrix, new.chain.shape[0], own)
        - _conditional_log_det(old.matrix, old.chain.shape[0], [])
        for new, old in zip(fitted.blocks, base.blocks, strict=True)
    )
    grouping = price_of_grouping(effect.only, problem.shots)
    return Price(volume + log_det(after) - log_det(before), shots, grouping)


def _conditional_log_det(matrix: Array, first: int, own: list[int]) -> float:
    """Return ln|H| of a shot's parameters without some of them, these integrated over."""
    inner = matrix[first:, first:]
    return log_det(inner) - (log_det(inner[np.ix_(own, own)]) if own else 0.0)


def _places_in_shot(problem: JointProblem, effect: Effect) -> list[int]:
    """Return where the numbers that the effect, added last, has in every shot are among its own."""
    model = problem.model
    first, count = len(model.shared), len(model.nuisances)
    numbers = [at - first for at in model.places[effect.id] if at >= first]
    return [*numbers, *range(count - effect.basis_size, count)]


def _prior_width(problem: JointProblem, name: ParameterName, effect: Effect) -> float:
    """Return the width in its coordinate of what is thought possible of an effect's number."""
    prior = effect_prior(problem, name)
    if prior is not None:
        return prior.u * math.sqrt(2.0 * math.pi)
    places, shared = problem.model.places[effect.id], len(problem.model.shared)
    return next(
        coordinate_width(parameter)
        for parameter, row in zip(effect.parameters, places, strict=True)
        if row < shared and name in problem.effect_keys(row)
    )


def coordinate_width(parameter: EffectParameter) -> float:
    """Return how far apart a number's physical limits are in its coordinate."""
    if parameter.form == "inverse" and math.isinf(parameter.high):
        return abs(parameter.coordinate(parameter.low))
    return abs(parameter.coordinate(parameter.high) - parameter.coordinate(parameter.low))
