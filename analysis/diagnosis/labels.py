"""Labels that are wrong for a whole group: the campaign with the labels corrected.

Two names exchanged; all shots of one name, or of one pair, that belong to another; names or sample
rates that are wrong for some time. A wrong name is far from a right one and no step leads there; so
each is tried on one shot of every pair, and those that come near noise are worth a fit of all. What
is wrong for some time is seen from a part of the campaign in which it is not.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np

from analysis.aliases import Array
from analysis.campaign import Campaign, Shot
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.odd_shots import RATE, ShotAlone
from analysis.fit import joint
from analysis.fit.fit_shot import FitShot
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.parameters import Side, of_material

TRIED = 2
"""Of a whole group that are worth a fit of all shots, those that come nearest. A choice of time: of
names of different materials hardly ever two come near."""
STEPS = 12
"""Of a fit of one shot of every pair. Measured: right names were reached in 3 to 6."""

PARTS = 3
"""Of each pair's shots, in the order of time. Derived: what is wrong for a third of the time in one
go touches two of three parts at most; in the middle it would touch both of two. A part of four has
13 of the usual 54 shots, hardly more than their nine pairs."""

SIDES: tuple[Side, ...] = ("sphere", "surface")

Name = Callable[[Shot], str | None]
"""What a shot's name should be; None where it stays."""


@dataclass(frozen=True)
class Relabelled:
    """A campaign with other names."""

    side: str
    """sphere or surface; cell where sample rates are wrong, not names."""
    group: str
    """Whose name is wrong."""
    sentence: str
    campaign: Campaign


def likely_labels(problem: JointProblem) -> list[Relabelled]:
    """Return labels under which one shot of every pair is nearly noise, then those of some time."""
    by_pair = _places_by_pair(problem.campaign)
    few = [places[0] for places in by_pair.values()]
    whole = (*_exchanged(problem.campaign), *_of_one_name(problem.campaign))
    near = _near(problem, whole, few)
    if not near and len(few) > 1:
        for pair, (place, *_) in by_pair.items():
            others = [at for at in few if at != place]
            # a pair whose name is wrong is one that the others do without
            if _squares(problem, problem.campaign, others) < CRITERIA.far_squares_per_sample:
                near += _near(problem, _of_one_pair(problem.campaign, pair), few)
    near.sort(key=lambda found: found[0])
    return [*(one for _, one in near[:TRIED]), *_wrong_for_some_time(problem)]


def _near(
    problem: JointProblem, tried: Iterable[Relabelled], places: Sequence[int]
) -> list[tuple[float, Relabelled]]:
    """Return the squares of those labels under which some shots are nearly noise, and these."""
    ways = list(tried)
    asked = problem.each(lambda one: _squares(problem, one.campaign, places), ways)
    most = CRITERIA.far_squares_per_sample
    return [found for found in zip(asked, ways, strict=True) if found[0] < most]


def _places_by_pair(campaign: Campaign) -> dict[tuple[str | None, str | None], list[int]]:
    """Return the places of the shots of each pair of names, in their order."""
    found: dict[tuple[str | None, str | None], list[int]] = {}
    for place, shot in enumerate(campaign.shots):
        found.setdefault((shot.sphere, shot.surface), []).append(place)
    return found


@np.errstate(over="ignore", invalid="ignore")  # under a wrong name a motion may run away
def _squares(problem: JointProblem, campaign: Campaign, places: Sequence[int]) -> float:
    """Return the squares a sample that the model leaves of some shots; infinite without a fit."""
    found = _fit(problem, campaign, places)
    return math.inf if found is None else _squares_per_sample(*found)


def _fit(
    problem: JointProblem, campaign: Campaign, places: Sequence[int]
) -> tuple[JointProblem, joint.Fitted] | None:
    """Return the model fitted to some shots; None without a fit."""
    if not places:
        return None
    shots = tuple(campaign.shots[at] for at in places)
    part = build(dataclasses.replace(campaign, shots=shots), problem.model)
    if not part.shots:
        return None
    part, nuisances = with_start(part)
    rough = joint.ROUGH_TOLERANCE
    fitted = joint.fit(part, nuisances, max_iterations=STEPS, tolerance=rough)
    return None if fitted.failed else (part, fitted)


def _squares_per_sample(part: JointProblem, fitted: joint.Fitted) -> float:
    """Return the squares a sample that a fit leaves."""
    return fitted.cost / sum(item.expected_squares for item in part.shots)


def _wrong_for_some_time(problem: JointProblem) -> Iterator[Relabelled]:
    """Yield labels of single shots under which all are like those of one part of the campaign."""
    campaign = problem.campaign
    seen: list[dict[int, dict[str, str | float]]] = []
    every_shot = with_start(problem)
    by_pair = _places_by_pair(campaign).values()
    for part in range(PARTS):
        # of each pair: shots of one pair are often dropped in one go
        slices = [slice(part * len(p) // PARTS, (part + 1) * len(p) // PARTS) for p in by_pair]
        places = sorted(at for p, of in zip(by_pair, slices, strict=True) for at in p[of])
        known = _fit(problem, campaign, places)
        if known is None or _squares_per_sample(*known) >= CRITERIA.far_squares_per_sample:
            continue
        right = _what_fits(*known, *every_shot)
        if right and right not in seen:
            seen.append(right)
            yield _put_right(campaign, right)


def _put_right(campaign: Campaign, right: Mapping[int, Mapping[str, Any]]) -> Relabelled:
    """Return a campaign with single shots corrected, given by their ids, and what was wrong."""
    shots = tuple(dataclasses.replace(s, **right.get(id(s), {})) for s in campaign.shots)
    before = {at: shot for at, shot in enumerate(campaign.shots) if id(shot) in right}
    rated = [at for at, shot in before.items() if RATE in right[id(shot)]]
    named = [at for at in before if at not in rated]
    said, side, group = [], "cell", RATE
    if named:
        likes = [right[id(before[at])] for at in named]
        side = "sphere" if all("sphere" in one for one in likes) else "surface"
        group = " and ".join(sorted({str(getattr(before[at], side)) for at in named}))
        names = sorted({str(name) for one in likes for name in one.values()})
        said.append(f"{_some_of(shots, named)} have wrong names: they are of {' or '.join(names)}")
    if rated:
        rates = sorted({1e-3 * shots[at].sample_rate_hz for at in rated})
        was = " or ".join(f"{one:g}" for one in rates)
        said.append(f"{_some_of(shots, rated)} have a wrong sample rate: it was {was} kHz")
    return Relabelled(side, group, "; ".join(said), dataclasses.replace(campaign, shots=shots))


def _some_of(shots: Sequence[Shot], places: Sequence[int]) -> str:
    """Return which shots of a campaign, each by its place where they are not one after another."""
    first, last = places[0], places[-1]
    one_by_one = f" (shots {', '.join(map(str, places))})" if last - first >= len(places) else ""
    return f"{len(places)} of {len(shots)} shots, from shot {first} to shot {last}{one_by_one},"


def _what_fits(
    part: JointProblem, fitted: joint.Fitted, whole: JointProblem, nuisances: Array
) -> dict[int, dict[str, str | float]]:
    """Return, by a shot's id, the names or the rate with which it follows a part of the shots.

    Of the shots that do not as they are written down; nothing where one never follows. What the
    part says nothing of stays as it is. ``nuisances`` of all shots are where theirs begin.
    """
    right: dict[int, dict[str, str | float]] = {}
    for item, own in zip(whole.shots, nuisances, strict=True):
        names = [of_material(side, str(getattr(item.shot, side))) for side in SIDES]
        if not set(names) <= set(part.names):
            continue
        alone, far = ShotAlone(part, fitted.theta, item, own), _far_from_noise(item)
        if alone.squares(item) < far:
            continue
        ways = (
            min(asked, key=lambda found: found[0], default=None)
            for asked in (alone.labels(), alone.rates())
        )
        near = next((way for way in ways if way is not None and way[0] < far), None)
        if near is None:
            return {}
        right[id(item.shot)] = near[2]
    return right


def _with_names(shot: Shot, names: Mapping[str, str]) -> Shot:
    return dataclasses.replace(
        shot, sphere=names.get("sphere", shot.sphere), surface=names.get("surface", shot.surface)
    )


def _far_from_noise(item: FitShot) -> float:
    """Return the squares of a shot from which a model is far from it."""
    return CRITERIA.far_squares_per_sample * item.expected_squares


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
        return _with_names(shot, {side: name})

    shots = tuple(named(shot) for shot in campaign.shots)
    return Relabelled(side, group, said, dataclasses.replace(campaign, shots=shots))
