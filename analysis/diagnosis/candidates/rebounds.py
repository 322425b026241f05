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
from analysis.fit.settle import settle
from analysis.model.impact_model import NUISANCE

SPEED, LOSS = NUISANCE.index("ln_v0"), NUISANCE.index("ln_e")
"""Places among a shot's own parameters."""
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
    if not fitted.blocks:
        return fitted
    gaining = np.flatnonzero(fitted.nuisances[:, LOSS] > 0.0)
    some = dataclasses.replace(problem, shots=[problem.shots[row] for row in gaining])
    nuisances = fitted.nuisances.copy()
    least = np.full(gaining.size, math.inf)
    for restitution in FROM:
        own = fitted.nuisances[gaining]
        own[:, LOSS] = math.log(restitution)
        for at, item in enumerate(some.shots):
            if item.speed_prior is not None:
                own[at, SPEED] = item.speed_prior.mean
        own = settle(some, fitted.theta, own)
        for at, item in enumerate(some.shots):
            cost = shot_cost(problem, item, fitted.theta, own[at])
            if cost < least[at] and own[at, LOSS] <= 0.0:
                least[at], nuisances[gaining[at]] = cost, own[at]
    if np.array_equal(nuisances, fitted.nuisances):
        return fitted
    again = joint.fit(problem, nuisances, theta=fitted.theta, max_iterations=max_iterations)
    return again if again.blocks and again.cost < fitted.cost else fitted
