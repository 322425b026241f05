"""A fit in which no shot leaves faster than it came."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from functools import partial

import numpy as np

from analysis.aliases import Array
from analysis.campaign import Quantity
from analysis.fit import joint
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle
from analysis.model.impact_model import NUISANCE

SPEED, LOSS = (NUISANCE.index(name) for name in ("ln_v0", "ln_e"))
"""Places among a shot's own parameters."""
USUAL_REBOUND = Quantity(0.8, 1e-4)
"""Speed after over speed before, at which such a shot is held. Chosen by trial: with 0.8, 0.85 and
0.95 a fit ended in the same minimum; with an uncertainty of 0.05 a far shot was not held at all."""


def fit_from_start(
    problem: JointProblem,
    nuisances: Array,
    progress: Callable[[str, float], None] | None = None,
    *,
    steps: int = joint.MAX_ITERATIONS,
) -> joint.Fitted:
    """Return a base model's fit from its start, without shots of a restitution above one."""
    fitted = joint.fit(problem, nuisances, progress=progress, max_iterations=steps)
    if joint.is_hopeless(problem, fitted.cost):
        return fitted
    return fitted_below_one(problem, fitted, partial(joint.fit, max_iterations=steps))


def fitted_below_one(
    problem: JointProblem, fitted: joint.Fitted, fit: Callable[..., joint.Fitted]
) -> joint.Fitted:
    """Return a fit without shots of a restitution above one, where it ends better without them.

    A model that lacks something large may bend a shot so far that it gains energy, and a start may
    be there where the top of a pulse is cut off. Once the effect is there, the shot's own numbers
    do not find back by steps: moduli that have followed them hold each of them back alone. So
    everything is fitted with the rebound of these shots held, and then without. ``fit`` does both.
    ``fitted`` itself where no shot gains energy, or where it is the better one.
    """
    if fitted.failed:
        return fitted
    gaining = np.flatnonzero(fitted.nuisances[:, LOSS] > 0.0).tolist()
    if not gaining:
        return fitted
    shots, nuisances = list(problem.shots), fitted.nuisances.copy()
    for row in gaining:
        item = shots[row]
        shot = dataclasses.replace(item.shot, restitution=USUAL_REBOUND)
        shots[row] = dataclasses.replace(item, shot=shot)
        nuisances[row, LOSS] = math.log(USUAL_REBOUND.value)
        if item.speed_prior is not None:
            nuisances[row, SPEED] = item.speed_prior.mean
    held = dataclasses.replace(problem, shots=shots)
    nuisances[gaining] = settle(held.with_shots(gaining), fitted.theta, nuisances[gaining])
    slower = fit(held, nuisances, theta=fitted.theta)
    if slower.failed:
        return fitted
    again = fit(problem, slower.nuisances, theta=slower.theta)
    return again if not again.failed and again.cost < fitted.cost else fitted
