r"""Profile likelihood: how much worse the best fit gets when one parameter is held elsewhere.

.. math:: p(x) = \min_{\theta: \theta_j = x} C(\theta) - \min_\theta C(\theta)

C is the cost of the joint fit: whitened squares and what was known before. For a Gaussian posterior
p is the parabola (x - x_0)^2 / u^2; where it is not, its 3.84 level is the honest 95 % interval.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.fit import joint, steps
from analysis.fit.problem import JointProblem
from analysis.written_numbers import K_95

LEVEL95 = K_95**2
"""Rise of the cost at the ends of a 95 % interval for one parameter."""
PIN = 1e4
"""How much sharper than the fit knows it a parameter is held."""
SEARCH_STEPS = 4
CLOSE_TO_LEVEL = 0.02
"""Relative; the end of an interval is then known to a hundredth of its length."""
FARTHEST_U = 12.0
"""An interval longer than this many u on one side is called open."""


@dataclass(frozen=True)
class Profile:
    """The cost along one parameter, the others at their best."""

    name: str
    at: Array
    """Where it was held, ascending, the best value among them. Shape (n,). [logarithm or
    coordinate]"""
    rise: Array
    """Cost above the minimum. Shape (n,). [1]"""
    low: float | None
    high: float | None
    """``low`` and ``high`` are the ends of the 95 % interval; None where it is open on that
    side."""


def _pinned(problem: JointProblem, j: int, x: float, u: float) -> JointProblem:
    """Return the problem with one global held at x, by a Gaussian much narrower than u."""
    precision, mean = problem.prior_precision.copy(), problem.prior_mean.copy()
    others = np.arange(mean.size) != j
    # what is known of the others, given x; solving with the pin inside would lose it to rounding
    block = precision[np.ix_(others, others)]
    mean[others] -= np.linalg.solve(block, precision[others, j] * (x - mean[j]))
    mean[j] = x
    precision[j, j] += (PIN / u) ** 2
    return dataclasses.replace(problem, prior_precision=precision, prior_mean=mean)


def cost_held_at(
    problem: JointProblem, fitted: joint.Fitted, name: str, x: float
) -> tuple[float, joint.Fitted]:
    """Return the least cost with one global held at x, and the fit there.

    x is a logarithm or a coordinate; ``fitted`` is a solution near by, to start from. The cost is
    infinite where the model cannot be evaluated.
    """
    j = problem.names.index(name)
    u = math.sqrt(float(fitted.covariance[j, j]))
    size = steps.step_towards(problem.names[j], x - float(fitted.theta[j]))
    start = steps.along(problem, fitted.theta, fitted.covariance[:, j] / u**2 * size)
    start[j] = x
    found = joint.fit(_pinned(problem, j, x, u), fitted.nuisances, theta=start)
    if found.failed:
        return math.inf, found
    d = found.theta - problem.prior_mean
    return float(d @ problem.prior_precision @ d) + sum(b.cost for b in found.blocks), found


def profile(problem: JointProblem, fitted: joint.Fitted, name: str) -> Profile:
    """Return the profile likelihood of one global and its 95 % interval.

    Source: Venzon & Moolgavkar 1988, Appl. Stat. 37, 87. Each point starts from the joint solution
    moved along its covariance. Validation: minimisation by scipy with the parameter taken out,
    ``tests/analysis/fit/test_profile.py``.
    """
    j = problem.names.index(name)
    best = float(fitted.theta[j])
    points = {best: 0.0}
    ends = [_end(problem, fitted, name, side, points) for side in (-1, 1)]
    at = np.array(sorted(points))
    return Profile(name, at, np.array([points[x] for x in at]), ends[0], ends[1])


def _end(
    problem: JointProblem, fitted: joint.Fitted, name: str, side: int, points: dict[float, float]
) -> float | None:
    """Return where the cost has risen to the 95 % level on one side; None where it never does."""
    j = problem.names.index(name)
    best, u = float(fitted.theta[j]), math.sqrt(float(fitted.covariance[j, j]))
    # the root of the rise is nearly straight, so false position finds the level in a step or two
    inner, outer = (0.0, 0.0), None
    distance = K_95
    for _ in range(SEARCH_STEPS + 3):
        if distance > FARTHEST_U:
            return None
        x = best + side * distance * u
        cost, _ = cost_held_at(problem, fitted, name, x)
        rise = max(cost - fitted.cost, 0.0)
        if math.isfinite(rise):
            points[x] = rise
        if abs(rise / LEVEL95 - 1) < CLOSE_TO_LEVEL:
            return x
        root = math.sqrt(min(rise, 1e6))
        if root < K_95:
            inner = (distance, root)
        else:
            outer = (distance, root)
        if outer is None:
            distance = max(1.5 * distance, min(distance * K_95 / max(root, 1e-3), 3 * distance))
        else:
            share = (K_95 - inner[1]) / (outer[1] - inner[1])
            distance = inner[0] + min(max(share, 0.05), 0.95) * (outer[0] - inner[0])
    if outer is None:
        return None
    share = (K_95 - inner[1]) / (outer[1] - inner[1])
    return best + side * u * (inner[0] + share * (outer[0] - inner[0]))
