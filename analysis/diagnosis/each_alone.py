"""Is the structure inside single shots? Each is fitted with a rig and materials of its own.

A wrong label, height, mass or gain, and a shot that does not belong, change what shots share: a
single shot still follows the model with other numbers. Where most shots do not, none of these is
the reason, and nobody need ask for them.
"""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.one_material import part_of_shots
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.score_test import chance_of
from analysis.diagnosis.selection import Step
from analysis.diagnosis.successive_halving import FEW, thinned
from analysis.fit import joint
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.window import quiet_part

OWN_U = 1.0
"""Standard uncertainty of the logarithm of the speed, and of each shared number, where a shot has
them for itself. Derived: a number that is wrong tenfold costs (ln 10)^2 = 5 squares, where noise
alone makes the squares of 3000 samples scatter by 77."""
STEPS_ALONE = 20
"""Of each fit. Measured: of 171 such fits in 20 campaigns with a mistake, all but one ended within
18."""


def is_inside_shots(step: Step, usual: joint.Fitted) -> bool:
    """Tell whether most shots leave structure even where each has a rig of its own.

    Asked of shots that stand for all. ``usual`` is where the model would be without a record.
    """
    problem = unwatched(step.problem)  # short, and part of the base fit
    places = thinned(problem, FEW)
    left = list(problem.each(partial(_left_alone, problem, (step.fitted, usual)), places))
    return sum(left) >= CRITERIA.half * len(places)


def _left_alone(problem: JointProblem, begins: tuple[joint.Fitted, ...], place: int) -> bool:
    """Tell whether a shot leaves more than noise, wherever its fit begins."""
    part, kept = part_of_shots(problem, [place])
    item = part.shots[0]
    prior = item.speed_prior
    if prior is not None:
        item = dataclasses.replace(item, speed_prior=dataclasses.replace(prior, u=OWN_U))
    most = (item.expected_squares + chance_of(item.expected_squares)) * _noisier_by(item)
    for begin in begins:
        free = dataclasses.replace(
            part,
            shots=[item],
            prior_mean=begin.theta[kept],
            prior_precision=np.eye(len(kept)) / OWN_U**2,
        )
        if _cost(free, begin, kept, place) <= most:
            return False
    return True


def _noisier_by(item: FitShot) -> float:
    """Return the power of a shot's own noise over that of all, at least 1: a gain scales it too."""
    quiet = quiet_part(item.shot)
    if quiet.size < CRITERIA.least_quiet_samples:
        return 1.0
    return max(1.0, float(np.mean(item.noise.whiten(quiet - quiet.mean()) ** 2)))


def _cost(free: JointProblem, begin: joint.Fitted, kept: list[int], place: int) -> float:
    fitted = joint.fit_to_compare(
        free, begin.nuisances[[place]], theta=begin.theta[kept], max_iterations=STEPS_ALONE
    )
    return np.inf if fitted.failed else fitted.cost
