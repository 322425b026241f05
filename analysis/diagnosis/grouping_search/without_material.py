"""The present model without one material's shots, each material in turn."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from analysis.diagnosis.candidates.subsets import PresentModel
from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.acts_on import ActsOn
from analysis.fit import joint
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle

MOST_STEPS = 40


@dataclass(frozen=True)
class WithoutMaterial:
    """A campaign without one material's shots.

    Attributes
    ----------
    only : ActsOn
        Which material, one alone.
    places, others : list of int
        Its shots in the campaign, and all the others.
    problem, fitted : JointProblem, Fitted
        The others, under the present model.
    left : float
        Whitened squares of the others beyond the noise.
    """

    only: ActsOn
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


def far_begin(present: PresentModel) -> joint.Fitted:
    """Return where fits to a part of the shots begin: at the whole's best unless that is ruined.

    Parameters
    ----------
    present : PresentModel
        The present model on all shots.

    Returns
    -------
    Fitted
        On all shots.
    """
    if (
        present.fitted.cost > CRITERIA.search.far_squares_per_sample * _samples(present.problem)
        and not present.problem.model.effects
    ):
        return dataclasses.replace(present.usual, theta=present.problem.start)
    return present.fitted


def without_each_material(present: PresentModel) -> list[WithoutMaterial]:
    """Return the campaign without each material in turn, what leaves least first.

    Parameters
    ----------
    present : PresentModel
        The present model, and where it would be without a record.

    Returns
    -------
    list of WithoutMaterial
        Empty where the residual is too small for the question.
    """
    if not excess(present.problem, present.fitted) > CRITERIA.grouping.asked_above:
        return []
    begin, every = far_begin(present), set(range(len(present.problem.shots)))
    found = []
    for only, places in _materials(present.problem).items():
        others = sorted(every - set(places))
        part, kept = part_of_shots(present.problem, others)
        theta = begin.theta[kept]
        nuisances = settle(part, theta, begin.nuisances[others])
        fitted = joint.fit(part, nuisances, theta=theta, max_iterations=MOST_STEPS)
        if fitted.blocks:
            left = excess(part, fitted)
            found.append(WithoutMaterial(only, places, others, part, fitted, left))
    return sorted(found, key=lambda f: f.left)


def _materials(problem: JointProblem) -> dict[ActsOn, list[int]]:
    """Return the shots of every material that some shots do without."""
    found: dict[ActsOn, list[int]] = {}
    for place, item in enumerate(problem.shots):
        for kind, name in (("surface", item.shot.surface), ("sphere", item.shot.sphere)):
            if name is not None:
                found.setdefault(ActsOn(kind, (name,)), []).append(place)
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
