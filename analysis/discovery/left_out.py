"""The present model without one material's shots, each material in turn."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from analysis.discovery.criteria import CRITERIA
from analysis.discovery.parts import Ground
from analysis.fit import joint
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle

MOST_STEPS = 40


@dataclass(frozen=True)
class LeftOut:
    """A campaign without one material's shots.

    Attributes
    ----------
    only : tuple of str
        Which material: (``surface`` or ``sphere``, name).
    places, others : list of int
        Its shots in the campaign, and all the others.
    problem, fitted : JointProblem, Fitted
        The others, under the present model.
    left : float
        Whitened squares of the others beyond the noise.
    """

    only: tuple[str, str]
    places: list[int]
    others: list[int]
    problem: JointProblem
    fitted: joint.Fitted
    left: float

    @property
    def share(self) -> float:
        """Return the share of the campaign's shots that remain."""
        return len(self.others) / (len(self.others) + len(self.places))


def _samples(problem: JointProblem) -> int:
    return sum(item.window.signal.size for item in problem.shots)


def excess(problem: JointProblem, fitted: joint.Fitted) -> float:
    """Return the whitened squares beyond the noise. [1]"""
    return fitted.cost - _samples(problem)


def chance(problem: JointProblem) -> float:
    """Return the squares beyond the noise that are no sign of more. [1]"""
    return CRITERIA.structure.excess_deviations * math.sqrt(2.0 * _samples(problem))


def far_begin(ground: Ground) -> joint.Fitted:
    """Return where fits to a part of the shots begin: at the whole's best unless that is ruined.

    Parameters
    ----------
    ground : Ground
        The present model on all shots.

    Returns
    -------
    Fitted
        On all shots.
    """
    if (
        ground.fitted.cost > CRITERIA.search.far_squares_per_sample * _samples(ground.problem)
        and not ground.problem.model.effects
    ):
        return dataclasses.replace(ground.usual, theta=ground.problem.start)
    return ground.fitted


def left_out(ground: Ground) -> list[LeftOut]:
    """Return the campaign without each material in turn, what leaves least first.

    Parameters
    ----------
    ground : Ground
        The present model, and where it would be without a record.

    Returns
    -------
    list of LeftOut
        Empty where the residual is too small for the question.
    """
    if not excess(ground.problem, ground.fitted) > CRITERIA.grouping.asked_above:
        return []
    begin, every = far_begin(ground), set(range(len(ground.problem.shots)))
    found = []
    for only, places in _materials(ground.problem).items():
        others = sorted(every - set(places))
        part, kept = part_of_shots(ground.problem, others)
        theta = begin.theta[kept]
        nuisances = settle(part, theta, begin.nuisances[others])
        fitted = joint.fit(part, nuisances, theta=theta, max_iterations=MOST_STEPS)
        if fitted.blocks:
            left = excess(part, fitted)
            found.append(LeftOut(only, places, others, part, fitted, left))
    return sorted(found, key=lambda f: f.left)


def _materials(problem: JointProblem) -> dict[tuple[str, str], list[int]]:
    """Return the shots of every material that some shots do without."""
    found: dict[tuple[str, str], list[int]] = {}
    for place, item in enumerate(problem.shots):
        for kind, name in (("surface", item.shot.surface), ("sphere", item.shot.sphere)):
            if name is not None:
                found.setdefault((kind, name), []).append(place)
    return {only: places for only, places in found.items() if len(places) < len(problem.shots)}


def part_of_shots(problem: JointProblem, places: list[int]) -> tuple[JointProblem, list[int]]:
    """Return a problem of some shots with the globals that these depend on.

    Parameters
    ----------
    problem : JointProblem
        Whole.
    places : list of int
        The shots.

    Returns
    -------
    part : JointProblem
        Same model, same knowledge.
    kept : list of int
        Where its globals are among the whole's.
    """
    shots = [problem.shots[at] for at in places]
    used = np.zeros(len(problem.names), dtype=bool)
    for item in shots:
        used |= problem.shared_local(item, problem.start)[1].any(axis=0)
    kept = np.flatnonzero(used).tolist()
    part = dataclasses.replace(
        problem,
        shots=shots,
        names=[problem.names[j] for j in kept],
        start=problem.start[kept],
        prior_mean=problem.prior_mean[kept],
        prior_precision=problem.prior_precision[np.ix_(kept, kept)],
    )
    return part, kept
