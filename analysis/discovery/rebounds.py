"""Shots that a fit lets rebound faster than they came: nothing does, and another place fits better.

A model that lacks something large may bend a shot so far that it gains energy; once the effect is
there, the shot's own numbers do not find back by steps.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from analysis.fit import joint
from analysis.fit.blocks import shot_cost
from analysis.fit.problem import JointProblem

FROM = (0.8, 0.5, 0.3)
"""Restitutions from which such a shot begins again."""


def fitted_below_one(
    problem: JointProblem, fitted: joint.Fitted, max_iterations: int
) -> joint.Fitted:
    """Return a fit without shots of a restitution above one, where it ends better without them.

    They move at once: moduli that have followed them hold each of them back alone.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        Any fit.
    max_iterations : int
        Steps allowed once shots have moved.

    Returns
    -------
    Fitted
        ``fitted`` itself where no shot gains energy, or none fares better elsewhere.
    """
    names = problem.model.nuisances
    if not fitted.blocks or "ln_e" not in names:
        return fitted
    loss = names.index("ln_e")
    gaining = np.flatnonzero(fitted.nuisances[:, loss] > 0.0)
    nuisances = fitted.nuisances.copy()
    for row in gaining:
        item = problem.shots[row]
        alone = dataclasses.replace(problem, shots=[item])
        least = math.inf
        for restitution in FROM:
            own = fitted.nuisances[row].copy()
            own[loss] = math.log(restitution)
            if item.speed_prior is not None:
                own[0] = item.speed_prior.mean
            own = joint.settle(alone, fitted.theta, own[None, :])[0]
            cost = shot_cost(problem, item, fitted.theta, own)
            if cost < least and own[loss] <= 0.0:
                least, nuisances[row] = cost, own
    if np.array_equal(nuisances, fitted.nuisances):
        return fitted
    again = joint.fit(problem, nuisances, theta=fitted.theta, max_iterations=max_iterations)
    return again if again.blocks and again.cost < fitted.cost else fitted
