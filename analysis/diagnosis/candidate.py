"""Named effects as hypotheses: an honest refit of what a cheap look promised."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.basis.proposals import (
    DELAY_STEPS,
    Proposal,
    column_is_difference,
    growth,
    rescoped,
    size_of,
    times_for,
)
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.marginal_likelihood import Price, price_of_effect
from analysis.effects.acts_on import ActsOn
from analysis.effects.effect import Effect, ShotContext
from analysis.fit import joint
from analysis.fit.below_one import fitted_below_one
from analysis.fit.blocks import shot_cost
from analysis.fit.nuisances import carried_over
from analysis.fit.physical_range import effect_out_of_range
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.settle import settle
from analysis.fit.stated_effects import effect_prior, stated_effects
from analysis.fit.steps import along
from analysis.fit.window import quiet_part
from analysis.parameters import ParameterName, of_effect

KNOWN_BEFORE = ("ln_v0", "ln_e")
"""What of a shot height and materials tell better than a model that is far from the record."""
HELD = 1e-3
"""How far an effect's coordinates may move from a far start while the rest comes near."""
STEPS_FROM_NEAR = 25
"""Of a fit that begins where one like it ended: another form or grouping, more shots. Measured in
eight campaigns with two effects: 51 of 55 such fits ended within 20 steps."""
MOST_HALVINGS = 8
"""Of a start's size: a step 256 times too long is no promise any more."""
COORDINATE_U = 20.0
"""Width that only keeps an effect's coordinate finite."""
NOTHING = Price()


@dataclass(frozen=True)
class Refit:
    """A model with one more effect, fitted for real."""

    effect: Effect
    """Added, with the scope that was fitted."""
    effect_id: str
    """Id of the library's entry."""
    scope: str
    problem: JointProblem
    fitted: joint.Fitted
    gain: float
    """Fall of the cost against the model without it."""
    parameters: int
    """How many numbers it has, over all groups."""
    at_bound: bool
    """A number left its physical range."""
    linear_gain: float
    """What the cheap look had promised."""
    on_all_shots: bool = True
    """False where only a part of the shots was fitted, the gain scaled to all."""
    own: int = 0
    """How many of the numbers belong to one shot each."""
    common: float = 0.0
    """Of the gain, what one size for all of these shots takes up as well; 0 where nobody asked."""
    price: Price = NOTHING
    """What its shared numbers cost."""

    @property
    def usable(self) -> bool:
        """Whether it was fitted to all shots and its numbers are such as the effect can have."""
        return self.on_all_shots and not self.at_bound

    def score(self, *, factor: float = 1.0) -> float:
        """Return twice the rise of ln Z, on so many times the shots."""
        gain, own = self.gain * factor, round(self.own * factor)
        shared = self.parameters - self.own
        # so many more shots leave each number's variance so much smaller
        paid = self.price.shared + shared * math.log(factor) + self.price.shots * factor
        paid += self.price.grouping
        if self.common > 0.0:  # around a size that they share, the shots' own only scatter
            paid += CRITERIA.price_of_number
        return gain - paid - price_of_scatter(own, gain - self.common * factor)


def price_of_scatter(own: int, gain: float) -> float:
    """Return what numbers that every shot has for itself cost in whitened squares.

    They are sizes of one scatter: with its width the data's own, ln Z falls by 1 + ln(squares they
    take up, each) for each of them. The price of the width is in it.
    """
    if not own:
        return 0.0
    width = CRITERIA.price_of_number
    return width + own * (1.0 + math.log(max(gain / own, 1.0)))


def fitted_coordinate(found: Refit, parameter: str) -> float | None:
    """Return the largest fitted coordinate of a number over its groups, None if there is none."""
    values = [
        float(v)
        for n, v in zip(found.problem.names, found.fitted.theta, strict=True)
        if n.is_of(found.effect.id, parameter)
    ]
    return max(values, key=abs, default=None)


def own_numbers(effect: Effect) -> int:
    """Return how many numbers of an effect every shot has for itself."""
    return effect.basis_size + sum(p.scope == "shot" for p in effect.parameters)


def extended(
    problem: JointProblem, fitted: joint.Fitted, effect: Effect, coordinates: dict[str, float]
) -> tuple[JointProblem, Array, Array]:
    """Return a problem with one more effect, and where to start it.

    ``coordinates`` are starts of new globals or numbers of shots by name. Returns the problem, and
    theta and nuisances to start from.
    """
    model = problem.model.with_effect(effect)
    larger = dataclasses.replace(problem, model=model)
    new: list[ParameterName] = []
    for row in range(len(problem.model.shared), len(model.shared)):
        new.extend(larger.effect_keys(row))
    # inputs stay behind everything else
    at = len(problem.names) - len(problem.inputs)
    larger.names = [*problem.names[:at], *new, *problem.names[at:]]
    start = np.array([coordinates.get(n, 0.0) for n in new])
    mine = range(at, at + len(new))
    for j, stated in stated_effects(larger):
        if j in mine:
            start[j - at] = stated.prior.mean
    size = len(larger.names)
    rest = [j for j in range(size) if j not in mine]
    larger.prior_precision = np.zeros((size, size))
    larger.prior_precision[np.ix_(rest, rest)] = problem.prior_precision
    for j in mine:
        larger.prior_precision[j, j] = COORDINATE_U**-2
    larger.prior_mean = np.insert(problem.prior_mean, at, start)
    for j, name in zip(mine, new, strict=True):
        prior = effect_prior(larger, name)
        if prior is not None:
            larger.prior_precision[j, j], larger.prior_mean[j] = prior.u**-2, prior.mean
    theta = np.insert(fitted.theta, at, start)
    larger.start = theta
    nuisances = carried_over(problem.model, model, fitted.nuisances, coordinates)
    return larger, theta, nuisances


def refit(
    problem: JointProblem,
    fitted: joint.Fitted,
    proposal: Proposal,
    *,
    scope: str,
    coefficients: dict[str, float],
    linear_gain: float,
    max_iterations: int = STEPS_FROM_NEAR,
    begin: joint.Fitted | None = None,
    only: ActsOn | None = None,
) -> Refit:
    """Return the model with one more effect, all parameters fitted again.

    The model's own parameters start from ``begin``, by default at its best: an effect that changes
    everything has drawn that best far from where it belongs. ``only`` are the materials that it
    acts on, with one amplitude; ``scope`` is then their kind.
    """
    free = proposal.effect.basis is not None
    effect = proposal.effect if free else rescoped(proposal.effect, "rig" if only else scope)
    effect = dataclasses.replace(effect, only=only)
    start: dict[str, float] = {}
    groups = {
        "rig": [only.label if only else ""],
        "surface": sorted({str(s.shot.surface) for s in problem.shots}),
        "sphere": sorted({str(s.shot.sphere) for s in problem.shots}),
    }
    for at, (parameter, coordinate) in enumerate(
        zip(effect.parameters, proposal.coordinates, strict=True)
    ):
        for group in groups.get(parameter.scope, [""]):
            value = coordinate
            if at == proposal.amplitude:
                found = coefficients.get(group, coordinate)
                # an outlandish first-order size only says "large": start from the usual one
                large = CRITERIA.far_larger * abs(coordinate)
                value = found if abs(found) < large else coordinate
            elif parameter.threshold and coefficients.get(group, 1.0) < CRITERIA.half:
                value = 0.0
            start[of_effect(effect.id, parameter.name, group)] = value
    power_law = begin is None and coefficients and column_is_difference(proposal)
    if power_law:
        start |= _sizes_that_do(proposal, effect, coefficients, problem, fitted)
    larger, theta, nuisances = extended(problem, begin or fitted, effect, start)
    if power_law:
        # the shots follow a delay; the rest is linear by then
        nuisances = settle(larger, theta, nuisances, steps=DELAY_STEPS)
        theta, nuisances = _drawn_near(larger, theta, nuisances, list(start), 1)
    elif begin is not None:
        nuisances = settle(larger, theta, nuisances, kept=KNOWN_BEFORE)
        theta, nuisances = _drawn_near(larger, theta, nuisances, list(start), max_iterations)
    elif coefficients and proposal.amplitude is not None:
        size = of_effect(effect.id, effect.parameters[proposal.amplitude].name)
        theta, nuisances = _moved_with_size(larger, theta, nuisances, size, fitted.cost)
    fit = partial(joint.fit_to_compare, max_iterations=max_iterations)
    result = fitted_below_one(larger, fit(larger, nuisances, theta=theta), fit)
    bare = Refit(effect, proposal.effect_id, scope, larger, result, 0.0, 0, False, linear_gain)
    return refitted(bare, problem, fitted)


def _sizes_that_do(
    proposal: Proposal,
    effect: Effect,
    coefficients: dict[str, float],
    problem: JointProblem,
    fitted: joint.Fitted,
) -> dict[str, float]:
    """Return the coordinates at which an effect does by its law what first order asks of it.

    By name. What is left of it beside all other parameters grows with a power of its size.
    """
    at = size_of(effect) or 0
    parameter, coordinate = effect.parameters[at], proposal.coordinates[at]
    whole = 1.0 if proposal.amplitude is None else coordinate
    power = growth(proposal, problem, fitted)
    found: dict[str, float] = {}
    for group, coefficient in coefficients.items():
        share = min(max(coefficient / whole, CRITERIA.nothing), CRITERIA.far_larger)
        size = parameter.value(coordinate) * times_for(share, power)
        name = of_effect(effect.id, parameter.name, group)
        found[name] = parameter.coordinate(min(max(size, parameter.low), parameter.high))
    return found


def _moved_with_size(
    problem: JointProblem, theta: Array, nuisances: Array, size: ParameterName, cost: float
) -> tuple[Array, Array]:
    """Return a start at which everything else has followed an effect's size, to first order.

    A size alone is no start: a contact that relaxes is softer, and the modulus must rise with it.
    From no effect, zero in these coordinates, everything goes along the line on which all else is
    at its best for the size. That line is straight where laws are; halved until it is no worse than
    no effect, as a slope overshoots where a law is bent, and from beyond a valley a fit runs away.
    """
    at = [j for j, name in enumerate(problem.names) if name.is_of(size.owner, size.quantity)]
    wanted, none = theta[at], theta.copy()
    none[at] = 0.0
    base = joint.fit(problem, nuisances, theta=none, max_iterations=0)
    if base.failed:
        return theta, nuisances
    matrix, vector, parts = joint.normal_equations(problem, base)
    rest = [j for j in range(theta.size) if j not in at]
    step = np.zeros(theta.size)
    step[at] = wanted
    load = vector[rest] - matrix[np.ix_(rest, at)] @ wanted
    step[rest] = np.linalg.solve(matrix[np.ix_(rest, rest)], load)
    own = np.array([part.own - part.back @ step for part in parts])
    share = 1.0
    for _ in range(MOST_HALVINGS):
        begun = along(problem, none, share * step), nuisances + share * own
        if joint.total_cost(problem, *begun) <= cost:
            return begun
        share *= 0.5
    return along(problem, none, share * step), nuisances + share * own


def _drawn_near(
    problem: JointProblem, theta: Array, nuisances: Array, own: list[str], max_iterations: int
) -> tuple[Array, Array]:
    """Return where everything else comes to while an effect's own numbers are held at a start.

    As long as the materials are far off, an effect's first steps make up for them and lead away.
    """
    at = [j for j in map(problem.index, own) if j is not None]
    held = dataclasses.replace(
        problem,
        prior_mean=problem.prior_mean.copy(),
        prior_precision=problem.prior_precision.copy(),
    )
    held.prior_mean[at] = theta[at]
    held.prior_precision[at, at] = HELD**-2
    near = joint.fit_to_compare(held, nuisances, theta=theta, max_iterations=max_iterations)
    return (theta, nuisances) if near.failed else (near.theta, near.nuisances)


def refitted(found: Refit, problem: JointProblem, base: joint.Fitted) -> Refit:
    """Return a refit with its gain, its numbers and whether they are physical, as its fit says.

    Its effect, scope, problem and fit are right before, the rest need not be. A fit that went
    nowhere explains minus infinity.
    """
    result = found.fitted
    felt = sum(found.effect.acts_on(s.shot.sphere, s.shot.surface) for s in problem.shots)
    own = own_numbers(found.effect) * felt
    return dataclasses.replace(
        found,
        gain=base.cost - result.cost if math.isfinite(result.cost) else -math.inf,
        parameters=len(found.problem.names) - len(problem.names) + own,
        at_bound=result.failed
        or left_its_range(found.problem, result, found.effect)
        or (
            found.effect.basis is None and base.cost - result.cost < CRITERIA.price_of_number * own
        ),
        own=own,
        price=_price(found, base),
    )


def _price(found: Refit, base: joint.Fitted) -> Price:
    """Return what an effect's numbers cost at its fit; nothing where it explains less than none.

    Such a fit is at no minimum, for the model holds its base, and Laplace's volume is not defined.
    """
    if found.fitted.failed or not found.fitted.cost <= base.cost:
        return NOTHING
    return price_of_effect(found.problem, found.fitted, base, found.effect)


def refit_elsewhere(
    found: Refit,
    *,
    few: list[int],
    many: list[int],
    few_base: joint.Fitted,
    base: joint.Fitted,
    problem: JointProblem,
    max_iterations: int,
    anchors: tuple[Array, Array] | None = None,
) -> Refit:
    """Return a refit carried on on more shots.

    ``few`` and ``many`` are places in the whole campaign. A new shot moves from its anchor as the
    shot most like it did; anchors are the nuisances without the effect unless given, for where the
    effect changes everything these are none.
    """
    if found.fitted.failed:
        return found
    wide = dataclasses.replace(found.problem, shots=problem.shots, checkpoint=problem.checkpoint)
    nuisances = np.zeros((len(many), found.fitted.nuisances.shape[1]))
    shared = [found.problem.model.nuisances.index(n) for n in problem.model.nuisances]
    old, new = anchors or (few_base.nuisances, base.nuisances)
    nuisances[:, shared] = new
    for row, place in enumerate(many):
        near = _most_alike(problem.shots[row], place, found.problem.shots, few)
        nuisances[row] += found.fitted.nuisances[near]
        nuisances[row, shared] -= old[near]
        like = _from(found.problem.shots[near], found.fitted.nuisances[near], problem.shots[row])
        costs = [
            shot_cost(wide, wide.shots[row], found.fitted.theta, own)
            for own in (nuisances[row], like)
        ]
        if costs[1] < costs[0]:  # an anchor that leads nowhere, as where a top is cut, is none
            nuisances[row] = like
    nuisances = settle(wide, found.fitted.theta, nuisances)
    fit = partial(joint.fit_to_compare, max_iterations=max_iterations)
    result = fitted_below_one(wide, fit(wide, nuisances, theta=found.fitted.theta), fit)
    return refitted(dataclasses.replace(found, problem=wide, fitted=result), problem, base)


def _from(near: FitShot, nuisances: Array, target: FitShot) -> Array:
    """Return a shot's own numbers for another: as they are, but with the speed of its height."""
    own = nuisances.copy()
    if near.speed_prior is not None and target.speed_prior is not None:
        own[0] += target.speed_prior.mean - near.speed_prior.mean
    return own


def _most_alike(target: FitShot, place: int, shots: list[FitShot], places: list[int]) -> int:
    """Return which of some shots is most like another: same pair, near height, near in time."""
    height = target.shot.drop_height_m or 0.0

    def distance(at: int) -> tuple[bool, float, int]:
        own = shots[at]
        off = abs((own.shot.drop_height_m or 0.0) - height)
        return own.pair != target.pair, off, abs(places[at] - place)

    return min(range(len(places)), key=distance)


def continued(base: joint.Fitted, found: Refit, *, max_iterations: int = 30) -> Refit:
    """Return a refit carried on from where it stopped."""
    fitted = found.fitted
    result = joint.fit_to_compare(
        found.problem, fitted.nuisances, theta=fitted.theta, max_iterations=max_iterations
    )
    bad = result.failed or left_its_range(found.problem, result, found.effect)
    further = dataclasses.replace(found, fitted=result, gain=base.cost - result.cost, at_bound=bad)
    return dataclasses.replace(further, price=_price(further, base))


def _alike(sizes: Array, groups: Sequence[float | None]) -> bool:
    """Tell whether the shots of a group have much of a signal in common."""
    members = [[at for at, g in enumerate(groups) if g == one] for one in set(groups)]
    if len(sizes) < CRITERIA.least_shots * len(members):
        return False
    common = sum(len(own) * float((sizes[own].mean(axis=0) ** 2).sum()) for own in members)
    return common > CRITERIA.half * max(float((sizes**2).sum()), 1e-300)


def left_its_range(problem: JointProblem, fitted: joint.Fitted, effect: Effect) -> bool:
    """Tell whether an effect's numbers are such as no such effect can have.

    Numbers outside their bounds, see `analysis.fit.physical_range`; or a free signal that is alike
    in all shots, or in those of a height, or absent before the trigger: the mains know neither when
    a sphere falls nor when it was let go.
    """
    if effect.basis is not None:
        first = problem.model.nuisances.index(of_effect(effect.id, "basis0"))
        sizes = fitted.nuisances[:, first : first + effect.basis_size]
        heights = [shot.shot.drop_height_m for shot in problem.shots]
        locked = _alike(sizes, [None] * len(sizes)) or _alike(sizes, heights)
        return locked or not is_there_before(problem.shots, effect, sizes)
    return any(effect_out_of_range(problem, fitted, effect))


def is_there_before(shots: list[FitShot], effect: Effect, sizes: Array) -> bool:
    """Tell whether the quiet parts hold as much of a signal as its sizes in the windows promise.

    Whitened power a coefficient, least squares in the quiet part against the fitted sizes in the
    window; chance brings 1 with a relative deviation of sqrt(2 / coefficients). The sizes have
    shape (shots, q). True where no quiet part is long enough to tell.
    """
    assert effect.basis is not None
    seen, promised = [], []
    for item, size in zip(shots, sizes, strict=True):
        quiet, samples = quiet_part(item.shot), item.window.signal.size
        if quiet.size < CRITERIA.least_quiet_samples:
            continue
        seen.append(_squares_before(item, quiet, effect) / size.size)
        context = _sampled(item.frame.sample_rate_hz)
        inside = item.whiten(effect.basis(samples, context) @ size)
        share = min(1.0, quiet.size / samples) ** 3  # of what is slow, a slope is left
        promised.append(share * float(inside @ inside) / size.size)
    if not seen:
        return True
    deviation = math.sqrt(2.0 / (len(seen) * sizes.shape[1]))
    chance = 1.0 - CRITERIA.excess_deviations * deviation
    return bool(np.mean(seen) - chance > CRITERIA.little * np.mean(promised))


def explains_more_before(shots: list[FitShot], one: Effect, other: Effect) -> bool:
    """Tell whether one free signal explains clearly more before the trigger than another does.

    Whitened squares beyond those of chance, which scatter by sqrt(2 coefficients).
    """
    quiet = [(item, quiet_part(item.shot)) for item in shots]
    enough = [own for own in quiet if own[1].size >= CRITERIA.least_quiet_samples]
    by_one, by_other = (
        sum(_squares_before(*own, effect) - effect.basis_size for own in enough)
        for effect in (one, other)
    )
    chance = CRITERIA.excess_deviations * math.sqrt(2.0 * one.basis_size * len(enough))
    return by_one - by_other > CRITERIA.little * by_one + chance


def _squares_before(item: FitShot, quiet: Array, effect: Effect) -> float:
    assert effect.basis is not None
    context = _sampled(item.frame.sample_rate_hz)
    columns = np.column_stack([np.ones(quiet.size), effect.basis(quiet.size, context)])
    basis, _ = np.linalg.qr(item.noise.whiten(columns))
    found = basis[:, 1:].T @ item.noise.whiten(quiet - quiet.mean())
    return float(found @ found)


def _sampled(rate_hz: float) -> ShotContext:
    nothing = math.nan
    return ShotContext(rate_hz, 0.0, nothing, nothing, nothing, nothing, None, None, None, nothing)
