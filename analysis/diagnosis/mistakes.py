"""Numbers written down wrong, and changes half-way: the campaign as it would be stated without.

Each is one number more: a mass, a radius, a height of a series, the level that heights are measured
from, the modulus of a reference, a gain or a coupon that is another from some shot on, a gain that
drifts; or another name (`labels`). By how much each would lower the squares follows from the normal
equations; the few that promise most are stated otherwise, and the base is fitted again. One that
leaves noise is named if no effect of the library does as well. It is never applied: the campaign
stays as it is written.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from analysis.aliases import Array
from analysis.campaign import Campaign, Shot, Sphere, Surface, Uncertainty, shot_words
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.labels import SIDES, likely_labels
from analysis.diagnosis.progress import MethodStep, Progress
from analysis.diagnosis.selection import Step
from analysis.fit import joint
from analysis.fit.blocks import linearise_shot
from analysis.fit.fit_shot import FitShot
from analysis.fit.freed_inputs import cost_with_free_inputs, numbers_of_shots, widened_by
from analysis.fit.inputs import Input
from analysis.fit.problem import JointProblem
from analysis.parameters import GAIN, Side, of_material

TRIED = 4
"""Mistakes that are fitted, those that promise most. A choice of time: each is a base fit."""
WIDE = 0.3
"""Standard uncertainty of the logarithm of a number that may be written down wrong: next to
nothing is known of it then, and its first digit is still right."""
FEWEST = 3
"""Shots on either side of a change. A choice: one or two are odd shots before they are a change."""
FASTEST = 20.0
"""Largest rate of a drift, per campaign. Derived: by 1/e within a twentieth, three of the usual 54
shots (`FEWEST`); what is faster is a change."""
LEAST_SEEN = 1e-6
"""Share of a number's information that must be its own. Derived: below it is the rounding of the
differences that its slope is made of, good to 1e-6."""


@dataclass(frozen=True)
class Mistake:
    """One mistake of the record, as it would be named."""

    id: str
    kind: str
    """What ``name`` is: sphere, surface, drop_height_m or cell."""
    name: str | float
    parameters: dict[str, tuple[float, float | None, str]]
    """Value, standard uncertainty and unit, by name."""
    sentence: str
    restated: Campaign
    """The campaign as it would be stated without the mistake."""
    cost: float = math.inf
    """The squares that are left once it is fitted, stated numbers uncertain and its own paid."""

    @property
    def in_time(self) -> bool:
        """Whether early and late shots differ by it, and nothing else tells them apart."""
        return self.id in ("change_point", "drift_in_time")

    @property
    def is_discrete(self) -> bool:
        """Whether it leaves no number free, so that it cannot follow what is another effect's."""
        return not self.parameters


@dataclass(frozen=True)
class Named:
    """The mistake that leaves noise, and those that the data cannot tell from it."""

    best: Mistake
    near: tuple[Mistake, ...]
    step: Step
    """The base fitted to the campaign without the mistake."""


Fit = Callable[[Campaign], tuple[JointProblem, joint.Fitted]]
"""How the base is fitted to a campaign."""


def named_mistake(step: Step, fit_base: Fit, progress: Progress) -> Named | None:
    """Return the mistake without which only noise is left; None where there is none.

    Names are asked where they can make the difference: not where shots of one condition differ in
    time, as they have the same names.
    """
    tried = [_fitted(one, fit_base, progress) for one in _likeliest(step)]
    found = _leaving_noise(tried)
    if not (found and found[0][0].in_time and repeated_in_time(step.problem)):
        tried += [_fitted(one, fit_base, progress) for one in _labels(step)]
        found = _leaving_noise(tried)
    if not found:
        return None
    best, again = found[0]
    return Named(best, tuple(one for one, _ in found[1:]), again)


def repeated_in_time(problem: JointProblem) -> bool:
    """Tell whether early and late shots share a condition.

    No effect of a rig and no name distinguishes these.
    """
    half = len(problem.shots) // 2
    ordered = sorted(problem.shots, key=lambda item: item.frame.place)
    early, late = ({item.condition for item in part} for part in (ordered[:half], ordered[half:]))
    return bool(early & late)


def _fitted(likely: Mistake, fit_base: Fit, progress: Progress) -> tuple[Mistake, Step]:
    """Return a mistake with what it leaves, and the base fitted to the campaign without it."""
    progress(MethodStep.STRUCTURE.told(f"is it a mistake? {likely.id} of {likely.name}"), 0.08)
    problem, fitted = fit_base(likely.restated)
    paid = CRITERIA.price_of_number * max(1, len(likely.parameters))
    cost = cost_with_free_inputs(problem, fitted) + paid
    return dataclasses.replace(likely, cost=cost), Step(problem, fitted)


def _leaving_noise(tried: Sequence[tuple[Mistake, Step]]) -> list[tuple[Mistake, Step]]:
    """Return the mistakes without which only noise is left, as far as they do about as well.

    The one that leaves the fewest squares is tested first. If its residual is not noise, neither is
    one with more squares.
    """
    found: list[tuple[Mistake, Step]] = []
    enough = math.inf
    for one, again in sorted(tried, key=lambda way: way[0].cost):
        if one.cost > enough:
            break
        if again.impossible:
            continue
        if again.structured:
            break
        enough = min(enough, one.cost + CRITERIA.least_lead)
        found.append((one, again))
    return found


def _labels(step: Step) -> list[Mistake]:
    """Return names that are wrong in a whole group, asked where they can be: far from noise."""
    samples = sum(item.expected_squares for item in step.problem.shots)
    if step.fitted.cost < CRITERIA.far_squares_per_sample * samples:
        return []
    return [
        Mistake(
            "wrong_sample_rate" if one.side == "cell" else "wrong_label",
            one.side,
            one.group,
            {},
            one.sentence,
            one.campaign,
        )
        for one in likely_labels(step.problem)
    ]


@np.errstate(over="ignore", invalid="ignore")  # far from the records a motion may run away
def _likeliest(step: Step) -> list[Mistake]:
    """Return the mistakes that promise most of what stated uncertainties leave, in order.

    Both are told by the same linearisation: far from the records it promises too little of both.
    """
    known = _Known.at(step)
    if known is None:
        return []
    least = CRITERIA.half * max(step.score_test.left - known.fall_within_statements, 0.0)
    ways = [*_numbers(known), *_moduli(known), *_changes(known)]
    ways.sort(key=lambda way: -way[0])
    found: list[Mistake] = []
    for promised, make in ways:
        if promised < least or len(found) == TRIED:
            break
        mistake = make()
        if mistake is not None:
            found.append(mistake)
    return found


Promise = tuple[float, Callable[[], Mistake | None]]
"""By how many squares a mistake promises to lower the misfit, and how to work it out."""


@dataclass(frozen=True)
class _Known:
    """The linearised base model, every stated number as uncertain as it is stated."""

    problem: JointProblem
    fitted: joint.Fitted
    """Stated numbers are exact in these two."""
    stated: tuple[Input, ...]
    """Those with an uncertainty."""
    doubted: tuple[Input, ...]
    """Masses, radii, heights and their levels, as if next to nothing were known of each."""
    matrix: Array
    vector: Array
    """Globals, then ``stated``, then ``doubted``; these last ones have no prior."""
    parts: list[tuple[Array, Array]]
    """The same of each shot."""

    @classmethod
    def at(cls, step: Step) -> _Known | None:
        """Return it at a fitted model; None where that cannot be linearised."""
        problem, fitted = step.problem, step.fitted
        if problem.inputs or problem.by_pair or fitted.failed:
            return None
        stated = numbers_of_shots(problem)
        known = widened_by(problem, stated, problem.prior_precision)
        doubted = tuple(_doubted(problem))
        wide = widened_by(known, doubted, known.prior_precision)
        theta = np.concatenate([fitted.theta, wide.start[fitted.theta.size :]])
        blocks = []
        for item, own in zip(wide.shots, fitted.nuisances, strict=True):
            block = linearise_shot(wide, item, theta, own)
            if block is None:
                return None
            blocks.append(block)
        there = dataclasses.replace(fitted, theta=theta, blocks=blocks)
        matrix, vector, parts = joint.normal_equations(wide, there)
        last = range(len(wide.names) - len(doubted), len(wide.names))
        matrix[last, last] -= [one.u**-2 for one in doubted]
        own_parts = [(part.matrix, part.vector) for part in parts]
        return cls(problem, fitted, stated, doubted, matrix, vector, own_parts)

    @property
    def size(self) -> int:
        """Return how many numbers are known: globals and stated ones."""
        return self.vector.size - len(self.doubted)

    @property
    def fall_within_statements(self) -> float:
        """Return by how much the squares fall where stated numbers move within their statements."""
        matrix, vector = self.matrix[: self.size, : self.size], self.vector[: self.size]
        return float(vector @ np.linalg.lstsq(matrix, vector, rcond=None)[0])

    def place_of(self, one: Input) -> int | None:
        """Return where a doubted number is among the stated ones."""
        own = [(i.kind, i.owner) for i in self.stated]
        at = (one.kind, one.owner)
        return self.fitted.theta.size + own.index(at) if at in own else None

    def fall(self, cross: Array, own: float, load: float) -> float:
        """Return by how much the squares fall with one more number, whose row is ``cross``."""
        left, pull = self._eliminated(cross, own, load, None)
        return pull**2 / left if left > LEAST_SEEN * own else 0.0

    def fall_without_statement(
        self, row: int, own: float, load: float, *, prior: float, away: float = 0.0, but: int
    ) -> float:
        """Return by how much the squares fall where what is stated of a number is left out.

        ``own`` and ``load`` are without that, of precision ``prior`` and as far ``away``; ``but``
        is the known number that says the same.
        """
        left, pull = self._eliminated(self.matrix[row], own, load, but)
        if not left > LEAST_SEEN * own:
            return 0.0
        with_it = prior * away**2 - (pull - prior * away) ** 2 / (left + prior)
        return pull**2 / left + with_it

    def _eliminated(
        self, cross: Array, own: float, load: float, but: int | None
    ) -> tuple[float, float]:
        """Return the information and the score of one more number beside all known but one."""
        kept = np.array([j for j in range(self.size) if j != but])
        against = np.column_stack([cross[kept], self.vector[kept]])
        back = np.linalg.lstsq(self.matrix[np.ix_(kept, kept)], against, rcond=None)[0]
        return own - float(cross[kept] @ back[:, 0]), load - float(cross[kept] @ back[:, 1])

    def value(self, one: Input) -> tuple[float, float] | None:
        """Return the coordinate at which a number fits best, and its standard uncertainty."""
        others = tuple(i for i in self.stated if (i.kind, i.owner) != (one.kind, one.owner))
        found = self.refitted(
            widened_by(self.problem, (*others, one), self.problem.prior_precision)
        )
        if found.failed:
            return None
        return float(found.theta[-1]), math.sqrt(float(found.covariance[-1, -1]))

    def refitted(self, wide: JointProblem) -> joint.Fitted:
        """Return the fit with more numbers free, from where they are stated."""
        theta = np.concatenate([self.fitted.theta, wide.start[self.fitted.theta.size :]])
        rough = joint.ROUGH_TOLERANCE
        return joint.fit(wide, self.fitted.nuisances, theta=theta, tolerance=rough)


# -- numbers ---------------------------------------------------------------------------------------
def _doubted(problem: JointProblem) -> Iterator[Input]:
    spheres = {i.shot.sphere for i in problem.shots if i.shot.sphere is not None}
    for name in sorted(spheres & set(problem.campaign.spheres)):
        ball = problem.campaign.spheres[name]
        for kind, value, unit in (("mass", ball.mass_kg, "kg"), ("radius", ball.radius_m, "m")):
            if value is not None:
                yield Input(kind, name, value, unit, Uncertainty(WIDE * value), "")
    surfaces = {i.shot.surface for i in problem.shots if i.shot.surface is not None}
    for name in sorted(surfaces & set(problem.campaign.surfaces)):
        mass = problem.campaign.surfaces[name].coupon_mass_kg
        if mass is not None:
            yield Input("coupon_mass", name, mass, "kg", Uncertainty(WIDE * mass), "")
    stated = {i.shot.drop_height_m for i in problem.shots if i.speed_prior is not None}
    heights = sorted(height for height in stated if height is not None)
    if len(heights) > 1:
        for height in heights:
            yield Input("height", f"{height:.6g}", height, "m", Uncertainty(WIDE * height), "")
        yield from _height_datums(problem, Uncertainty(WIDE * heights[0]))


def _height_datums(problem: JointProblem, u: Uncertainty) -> Iterator[_HeightDatum]:
    """Yield other levels that heights may be measured from.

    One offset for the drops of a material (one for all drops is an effect of the release); or for
    all spheres the same one of `DATUMS`, where their radii differ.
    """
    fallen = [i for i in problem.shots if i.speed_prior is not None]
    radii = {i.radius_m for i in fallen}
    if len(radii) > 1 and None not in radii:
        yield _HeightDatum("height_offset", None, 0.0, "1", Uncertainty(1.0), "")
    for side in SIDES:
        owners = {getattr(i.shot, side) for i in fallen}
        if len(owners) > 1:
            for owner in sorted(name for name in owners if name is not None):
                yield _HeightDatum("height_offset", owner, 0.0, "m", u, "", side=side)


DATUMS = (1, 2)
"""Where people measure a sphere's height from: its centre, its top. [radii above its bottom]"""


@dataclass(frozen=True)
class _HeightDatum(Input):
    """What is to be added to stated heights; in radii of the sphere where its unit is 1."""

    side: Side | None = None
    """Of the material that ``owner`` is; None for all drops."""

    def belongs_to(self, item: FitShot) -> bool:
        """Tell whether it is a number of this shot."""
        own = self.side is None or getattr(item.shot, self.side) == self.owner
        return own and super().belongs_to(item)

    def moved(self, item: FitShot, by: float) -> FitShot:
        """Return a shot with this input's coordinate changed by ``by``."""
        return super().moved(item, by * self.unit_of(item.radius_m))

    def unit_of(self, radius_m: float | None) -> float:
        """Return its unit for a sphere of a radius. [m]"""
        return 1.0 if self.unit == "m" or radius_m is None else radius_m


def _wrong_datum(known: _Known, one: _HeightDatum) -> Mistake | None:
    found = known.value(one)
    if found is None:
        return None
    problem, campaign = known.problem, known.problem.campaign
    added, u = one.value_at(found[0]), found[1] / one.scale
    if one.unit == "1" and min(abs(abs(added) - n) for n in DATUMS) > CRITERIA.deviations * u:
        return None
    units = {id(i.shot): one.unit_of(i.radius_m) for i in problem.shots if one.belongs_to(i)}

    def from_the_datum(shot: Shot) -> Shot:
        """Return a shot with its height from the level of the others."""
        unit, stated = units.get(id(shot)), shot.drop_height_m
        if unit is None or stated is None:
            return shot
        known_to = shot.u_drop_height_m.u if shot.u_drop_height_m else 0.0
        own = Uncertainty(math.hypot(u * unit, known_to))
        return dataclasses.replace(shot, drop_height_m=stated + added * unit, u_drop_height_m=own)

    shots = tuple(from_the_datum(shot) for shot in campaign.shots)
    if any(shot.drop_height_m is not None and not shot.drop_height_m > 0.0 for shot in shots):
        return None
    if one.unit == "m":
        size, name = _figure(abs(added), "m", u), "height_offset_m"
    else:
        size, name = f"{_figure(abs(added), '', u)} {RADII}", "height_offset_radii"
    whose = "all heights" if one.side is None else f"the heights of {one.owner}"
    said = f"{whose} are stated too {'large' if added < 0 else 'small'} by {size}"
    return Mistake(
        "wrong_height",
        one.side or "rig",
        one.owner or "all",
        {name: (added, u, one.unit)},
        f"{said}: they are measured from another level",
        dataclasses.replace(campaign, shots=shots),
    )


def _numbers(known: _Known) -> Iterator[Promise]:
    for j, one in enumerate(known.doubted, start=known.size):
        at, own, load = known.place_of(one), float(known.matrix[j, j]), float(known.vector[j])
        if at is None:  # it is taken as exact
            fall = known.fall(known.matrix[j], own, load)
        else:
            prior = float(known.matrix[at, at]) - own
            fall = known.fall_without_statement(j, own, load, prior=prior, but=at)
        make: Callable[[], Mistake | None] = partial(_number, known, one)
        if isinstance(one, _HeightDatum):
            make = partial(_wrong_datum, known, one)
        yield fall - CRITERIA.price_of_number, make


def _number(known: _Known, one: Input) -> Mistake | None:
    found = known.value(one)
    if found is None:
        return None
    value, u = math.exp(found[0]), math.exp(found[0]) * found[1]
    campaign, owner = known.problem.campaign, one.owner or ""
    said = (
        f"stated {_figure(one.value, one.unit)}, the recordings say {_figure(value, one.unit, u)}"
    )
    doubt = Uncertainty(WIDE * value)
    if one.kind == "height":
        shots = tuple(
            dataclasses.replace(s, drop_height_m=value, u_drop_height_m=doubt)
            if s.drop_height_m == one.value
            else s
            for s in campaign.shots
        )
        return Mistake(
            "wrong_height",
            "drop_height_m",
            one.value,
            {"drop_height_m": (value, u, "m")},
            f"the height of a series is written down wrong: {said}",
            dataclasses.replace(campaign, shots=shots),
        )
    if one.kind == "coupon_mass":
        coupon = dataclasses.replace(
            campaign.surfaces[owner], coupon_mass_kg=value, u_coupon_mass_kg=doubt
        )
        return Mistake(
            "wrong_mass",
            "surface",
            owner,
            {"coupon_mass_kg": (value, u, "kg")},
            f"the mass of the coupon {owner} is written down wrong: {said}",
            dataclasses.replace(campaign, surfaces={**campaign.surfaces, owner: coupon}),
        )
    ball = campaign.spheres[owner]
    if one.kind == "mass":
        ball = dataclasses.replace(ball, mass_kg=value, u_mass_kg=doubt)
    else:
        ball = dataclasses.replace(ball, radius_m=value, u_radius_m=doubt)
    return Mistake(
        f"wrong_{one.kind}",
        "sphere",
        owner,
        {f"{one.kind}_{one.unit}": (value, u, one.unit)},
        f"the {one.kind} of {owner} is written down wrong: {said}",
        dataclasses.replace(campaign, spheres={**campaign.spheres, owner: ball}),
    )


def _moduli(known: _Known) -> Iterator[Promise]:
    """Yield the stated moduli, each against all the rest, as Baarda's data snooping has it."""
    problem, campaign = known.problem, known.problem.campaign
    sides: tuple[tuple[Side, Mapping[str, Sphere | Surface]], ...] = (
        ("sphere", campaign.spheres),
        ("surface", campaign.surfaces),
    )
    for side, materials in sides:
        for name, material in sorted(materials.items()):
            j = problem.index(of_material(side, name))
            if j is None or material.youngs_modulus_pa is None:
                continue
            prior = float(problem.prior_precision[j, j])
            away = float(known.fitted.theta[j] - problem.prior_mean[j])
            own, load = known.matrix[j, j] - prior, known.vector[j] + prior * away
            fall = known.fall_without_statement(j, own, load, prior=prior, away=away, but=j)
            yield fall - CRITERIA.price_of_number, partial(_modulus, known, side, name)


def _modulus(known: _Known, side: Side, name: str) -> Mistake | None:
    problem, campaign = known.problem, known.problem.campaign
    j = problem.names.index(of_material(side, name))
    precision = problem.prior_precision.copy()
    precision[j, j] = WIDE**-2
    found = known.refitted(widened_by(problem, known.stated, precision))
    if side == "sphere":
        stated = campaign.spheres[name].youngs_modulus_pa
        ball = dataclasses.replace(campaign.spheres[name], youngs_modulus_pa=None)
        campaign = dataclasses.replace(campaign, spheres={**campaign.spheres, name: ball})
    else:
        stated = campaign.surfaces[name].youngs_modulus_pa
        coupon = dataclasses.replace(campaign.surfaces[name], youngs_modulus_pa=None)
        campaign = dataclasses.replace(campaign, surfaces={**campaign.surfaces, name: coupon})
    if found.failed or stated is None:
        return None
    value = stated.value * math.exp(float(found.theta[j] - problem.prior_mean[j]))
    u = value * math.sqrt(float(found.covariance[j, j]))
    said = f"stated {_figure(stated.value, 'Pa')}, the recordings say {_figure(value, 'Pa', u)}"
    return Mistake(
        "wrong_modulus",
        side,
        name,
        {"youngs_modulus_Pa": (value, u, "Pa")},
        f"the modulus of {name} is written down wrong: {said}",
        campaign,
    )


# -- changes in the course of the campaign ---------------------------------------------------------
def _changes(known: _Known) -> Iterator[Promise]:
    """Yield changes of the gain and of each coupon, from every shot on, and a drift of the gain."""
    problem = known.problem
    places = np.array([item.frame.place for item in problem.shots])
    order = np.argsort(places)
    paid = 2.0 * CRITERIA.price_of_number

    def promised(column: int, weights: Array) -> float:
        cross, load, own = np.zeros(known.vector.size), 0.0, 0.0
        for weight, (matrix, vector) in zip(weights, known.parts, strict=True):
            cross += weight * matrix[column]
            load += weight * vector[column]
            own += weight**2 * matrix[column, column]
        return known.fall(cross, own, load)

    gain = problem.index(GAIN)
    columns: list[tuple[int, str | None, list[int]]] = []
    if gain is not None:
        columns.append((gain, None, order.tolist()))
        if order.size > 2 * FEWEST:
            found = minimize_scalar(
                lambda rate: -promised(gain, _course(places, float(rate))),
                bounds=(-FASTEST, FASTEST),
                method="bounded",
            )
            steady = promised(gain, _course(places, 0.0))
            settling = -float(found.fun) - CRITERIA.price_of_number
            fall, rate = max((steady, 0.0), (settling, float(found.x)))
            yield fall - paid, partial(_drift, known, rate)
    for surface in sorted({i.shot.surface for i in problem.shots if i.shot.surface}):
        j = problem.index(of_material("surface", surface))
        if j is not None:
            own = [at for at in order.tolist() if problem.shots[at].shot.surface == surface]
            columns.append((j, surface, own))
    for column, on, own in columns:
        ways = [
            (promised(column, (places >= places[at]).astype(float)), at)
            for at in own[FEWEST : len(own) - FEWEST + 1]
        ]
        if ways:
            fall, at = max(ways)
            yield fall - paid, partial(_change, known, on, problem.shots[at])


def _course(places: Array, rate: float) -> Array:
    """Return how much of a drift has happened at each place, 0 at the first and 1 at the last.

    What is left of it falls as exp(-rate x). It is steady at a rate of 0; below, most comes late.
    """
    x = places + 0.5
    return np.asarray(np.expm1(-rate * x) / np.expm1(-rate)) if rate else x


@dataclass(frozen=True)
class _Gain(Input):
    """A gain that is another in the course of a campaign."""

    since: float | None = None
    """Place of the first shot that has it; None for a drift over all."""
    rate: float = 0.0
    """Of the drift, per campaign; see `_course`."""

    def weight(self, item: FitShot) -> float:
        """Return which part of it a shot has."""
        if self.since is None:
            return float(_course(np.array(item.frame.place), self.rate))
        return float(item.frame.place >= self.since)

    def local_slopes(
        self, item: FitShot, names: Sequence[str], *, by_moduli: bool
    ) -> list[tuple[int, float]]:
        """Return how the logarithm of newtons per volt follows."""
        return [(names.index("ln_S"), self.weight(item))]


def _amplified(
    known: _Known, since: float | None, rate: float = 0.0
) -> tuple[float, float, Campaign] | None:
    """Return by how much the logarithm of volts per newton changed, its u, and all as at first."""
    one = _Gain("converter_gain", None, 1.0, "1", Uncertainty(WIDE), "", since=since, rate=rate)
    found = known.value(one)
    if found is None:
        return None
    problem = known.problem
    weights = {id(item.shot): one.weight(item) for item in problem.shots}

    def as_at_first(shot: Shot) -> Shot:
        by = math.exp(found[0] * weights.get(id(shot), 0.0))
        signal = shot.code_zero + by * (shot.signal - shot.code_zero)
        # a full scale is known by the step: it is as many volts less
        quantum = None if shot.quantum is None else by * shot.quantum
        return dataclasses.replace(shot, signal=signal, quantum=quantum)

    shots = tuple(as_at_first(shot) for shot in problem.campaign.shots)
    return -found[0], found[1], dataclasses.replace(problem.campaign, shots=shots)


def _change(known: _Known, surface: str | None, first: FitShot) -> Mistake | None:
    campaign = known.problem.campaign
    at = [id(shot) for shot in campaign.shots].index(id(first.shot))
    parameters: dict[str, tuple[float, float | None, str]] = {"first_shot": (float(at), None, "1")}
    begins = f"from {shot_words(at, first.shot.name)} on"
    if surface is None:
        found = _amplified(known, first.frame.place)
        if found is None:
            return None
        factor = math.exp(found[0])
        parameters["factor"] = (factor, factor * found[1], "1")
        size = _figure(factor, "", factor * found[1])
        said = f"{begins} the signal is {size} of what it was: the gain changed"
        return Mistake("change_point", "cell", "gain", parameters, said, found[2])
    later = f"{surface}, {begins}"
    shots = tuple(
        dataclasses.replace(shot, surface=later) if shot.surface == surface and i >= at else shot
        for i, shot in enumerate(campaign.shots)
    )
    other = dataclasses.replace(campaign.surfaces[surface], name=later)
    restated = dataclasses.replace(
        campaign, shots=shots, surfaces={**campaign.surfaces, later: other}
    )
    said = f"{begins} {surface} is another coupon, or was changed"
    return Mistake("change_point", "surface", surface, parameters, said, restated)


def _drift(known: _Known, rate: float) -> Mistake | None:
    found = _amplified(known, None, rate)
    if found is None:
        return None
    share, u, restated = found
    size = _figure(100.0 * share, "%", 100.0 * u)
    said = f"the signal drifts by {size} from the first shot to the last"
    if rate:
        said += f", most of it {'early' if rate > 0.0 else 'late'}"
    parameters: dict[str, tuple[float, float | None, str]] = {"share": (share, u, "1")}
    return Mistake("drift_in_time", "cell", "gain", parameters, said, restated)


# -- words -----------------------------------------------------------------------------------------
RADII = "radii of the sphere (1: its centre; 2: its top)"
SHOWN = {"kg": (1e3, "g"), "m": (1e3, "mm"), "Pa": (1e-9, "GPa"), "%": (1.0, "%"), "": (1.0, "")}


def _figure(value: float, unit: str, u: float | None = None) -> str:
    """Return a number in a handy unit, with its standard uncertainty in two digits."""
    scale, name = SHOWN[unit]
    end = f" {name}" if name else ""
    if u is None or not u > 0:
        return f"{scale * value:.5g}{end}"
    digits = max(0, 1 - math.floor(math.log10(scale * u)))
    return f"{scale * value:.{digits}f} +- {scale * u:.{digits}f}{end}"
