"""Parts of a campaign: shots that stand for all, and the model they stand on."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

from analysis.fit import joint
from analysis.fit.problem import JointProblem


def thinned(problem: JointProblem, count: int) -> list[int]:
    """Return the places of shots that stand for all.

    Parameters
    ----------
    problem : JointProblem
        Whole campaign.
    count : int
        How many are wanted at least, where there are so many.

    Returns
    -------
    list of int
        In order of time; all pairs take part, then all heights, then repeats spread over time.
    """
    groups: dict[tuple[str, float], list[int]] = {}
    for place, item in enumerate(problem.shots):
        groups.setdefault((item.pair, item.shot.drop_height_m or 0.0), []).append(place)
    by_pair: dict[str, list[list[int]]] = {}
    for (pair, _), places in sorted(groups.items()):
        by_pair.setdefault(pair, []).append(places)
    pairs = [by_pair[p] for p in sorted(by_pair)]
    chosen: list[int] = []
    for turn in range(max(len(p) for p in groups.values()) * max(len(p) for p in pairs)):
        for at, heights in enumerate(pairs):
            # a staircase: neighbouring pairs begin at different heights
            group = heights[(turn + at) % len(heights)]
            free = [i for i in group if i not in chosen]
            if free and (len(chosen) < count or turn == 0):
                chosen.append(free[(turn + at) % len(free)])
        if len(chosen) >= count:
            break
    return sorted(chosen)


def part_of(
    problem: JointProblem, fitted: joint.Fitted, places: list[int]
) -> tuple[JointProblem, joint.Fitted]:
    """Return a campaign of some of the shots, the same model fitted to them."""
    if len(places) == len(problem.shots):
        return problem, fitted
    few = dataclasses.replace(problem, shots=[problem.shots[i] for i in places])
    return few, joint.fit(few, fitted.nuisances[places], theta=fitted.theta)


@dataclass(frozen=True)
class PresentModel:
    """What a turn stands on.

    Attributes
    ----------
    problem, fitted : JointProblem, Fitted
        The present model at its best on all shots.
    usual : Fitted
        The base model at what was known before, for all shots.
    """

    problem: JointProblem
    fitted: joint.Fitted
    usual: joint.Fitted

    def begin(self, places: list[int], base: joint.Fitted) -> joint.Fitted:
        """Return where a far start begins on some shots: usual place, present effects as fitted."""
        theta = base.theta.copy()
        theta[: self.usual.theta.size] = self.usual.theta
        nuisances = base.nuisances.copy()
        nuisances[:, : self.usual.nuisances.shape[1]] = self.usual.nuisances[places]
        return dataclasses.replace(base, theta=theta, nuisances=nuisances)


@dataclass(frozen=True)
class Part:
    """Some of the shots, and the present model fitted to them."""

    places: list[int]
    base: joint.Fitted
