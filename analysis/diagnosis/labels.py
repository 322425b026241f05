"""Labels that are wrong for a whole group: the campaign with the labels corrected.

Two names exchanged; all shots of one name, or of one pair, that belong to another. A wrong name is
far from a right one and no step leads there; so each is tried on one shot of every pair, and those
that come near noise are worth a fit of all.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.criteria import CRITERIA
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start

TRIED = 2
"""That are worth a fit of all shots, those that come nearest. A choice of time: of names of
different materials hardly ever two come near."""
STEPS = 12
"""Of a fit of one shot of every pair. Measured: right names were reached in 3 to 6."""

Name = Callable[[Shot], str | None]
"""What a shot's name should be; None where it stays."""


@dataclass(frozen=True)
class Relabelled:
    """A campaign with other names."""

    side: str
    """sphere or surface."""
    group: str
    """Whose name is wrong."""
    sentence: str
    campaign: Campaign


def likely_labels(problem: JointProblem) -> list[Relabelled]:
    """Return labels under which one shot of every pair is nearly noise, the nearest first."""
    by_pair: dict[tuple[str | None, str | None], int] = {}
    for place, shot in enumerate(problem.campaign.shots):
        by_pair.setdefault((shot.sphere, shot.surface), place)
    few = list(by_pair.values())
    whole = (*_exchanged(problem.campaign), *_of_one_name(problem.campaign))
    near = _near(problem, whole, few)
    if not near and len(few) > 1:
        for pair, place in by_pair.items():
            others = [at for at in few if at != place]
            # a pair whose name is wrong is one that the others do without
            if _squares(problem, problem.campaign, others) < CRITERIA.far_squares_per_sample:
                near += _near(problem, _of_one_pair(problem.campaign, pair), few)
    near.sort(key=lambda found: found[0])
    return [one for _, one in near[:TRIED]]


def _near(
    problem: JointProblem, tried: Iterable[Relabelled], places: Sequence[int]
) -> list[tuple[float, Relabelled]]:
    """Return the squares of those labels under which some shots are nearly noise, and these."""
    ways = list(tried)
    asked = problem.each(lambda one: _squares(problem, one.campaign, places), ways)
    most = CRITERIA.far_squares_per_sample
    return [found for found in zip(asked, ways, strict=True) if found[0] < most]


@np.errstate(over="ignore", invalid="ignore")  # under a wrong name a motion may run away
def _squares(problem: JointProblem, campaign: Campaign, places: Sequence[int]) -> float:
    """Return the squares a sample that the model leaves of some shots; infinite without a fit."""
    shots = tuple(campaign.shots[at] for at in places)
    part = build(dataclasses.replace(campaign, shots=shots), problem.model)
    if not part.shots:
        return math.inf
    part, nuisances = with_start(part)
    rough = joint.ROUGH_TOLERANCE
    fitted = joint.fit(part, nuisances, max_iterations=STEPS, tolerance=rough)
    return math.inf if fitted.failed else fitted.cost / sum(item.data for item in part.shots)


SIDES = ("sphere", "surface")


def _names(campaign: Campaign, side: str) -> tuple[list[str], list[str]]:
    """Return the names that shots have, and all that are known."""
    used = sorted({name for shot in campaign.shots if (name := getattr(shot, side)) is not None})
    known = campaign.spheres if side == "sphere" else campaign.surfaces
    return [name for name in used if name in known], sorted(known)


def _exchanged(campaign: Campaign) -> Iterator[Relabelled]:
    for side in SIDES:
        for one, other in combinations(_names(campaign, side)[0], 2):
            said = f"the names {one} and {other} are exchanged in all shots"
            to = {one: other, other: one}
            yield _renamed(campaign, side, f"{one} and {other}", said, _by_name(side, to))


def _of_one_name(campaign: Campaign) -> Iterator[Relabelled]:
    for side in SIDES:
        used, known = _names(campaign, side)
        for name in used:
            for right in known:
                if right != name:
                    said = f"all shots labelled {name} are of {right}"
                    yield _renamed(campaign, side, name, said, _by_name(side, {name: right}))


def _of_one_pair(campaign: Campaign, pair: tuple[str | None, str | None]) -> Iterator[Relabelled]:
    sphere, surface = pair
    for side, name in zip(SIDES, pair, strict=True):
        for right in _names(campaign, side)[1]:
            if right != name:
                group = f"{sphere} on {surface}"
                said = f"all shots labelled {group} are of {right}, not {name}"
                yield _renamed(campaign, side, group, said, _in_pair(pair, right))


def _by_name(side: str, to: dict[str, str]) -> Name:
    return lambda shot: to.get(getattr(shot, side))


def _in_pair(pair: tuple[str | None, str | None], right: str) -> Name:
    return lambda shot: right if (shot.sphere, shot.surface) == pair else None


def _renamed(campaign: Campaign, side: str, group: str, said: str, right: Name) -> Relabelled:
    def named(shot: Shot) -> Shot:
        name = right(shot)
        if name is None:
            return shot
        by_side = {"sphere": shot.sphere, "surface": shot.surface, side: name}
        return dataclasses.replace(shot, sphere=by_side["sphere"], surface=by_side["surface"])

    shots = tuple(named(shot) for shot in campaign.shots)
    return Relabelled(side, group, said, dataclasses.replace(campaign, shots=shots))
