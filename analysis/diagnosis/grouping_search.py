"""The search over groupings by ln Z: on which shots an effect acts, and which share its size.

A linear look chooses the grouping before the effect is known. Once it is fitted, the other ones
are one refit away: one size for the rig, for some surfaces or for some spheres, one for each
surface or sphere, one for each shot. Of the sets of some materials those are fitted that the sizes
of the single materials promise most of (`Sizes`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.groupings import Sizes
from analysis.diagnosis.basis.proposals import can_be_negative, rescoped, scopes_of, size_of
from analysis.diagnosis.candidate import STEPS_FROM_NEAR, Refit, extended, refitted
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.linearised import Projection
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.successive_halving import as_good_on_part, better_on_part
from analysis.effects.acts_on import KINDS, ActsOn
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.blocks import linearise_shot
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem
from analysis.parameters import of_effect

SETS_FITTED = 2
"""Sets of some materials that are fitted for each kind, the most promising ones. A choice of time:
each is a fit to all shots."""


def best_grouping(
    problem: JointProblem, base: joint.Fitted, found: Refit, *, of_some: bool = True
) -> Refit:
    """Return an effect's refit in the grouping that explains most, numbers and choices paid for.

    ``found`` itself where no other does better. Sets of some materials are not asked where the
    shots are one material's.
    """
    others = list(_regrouped(problem, base, found, of_some=of_some))
    return max((found, *(r for r in others if not r.at_bound)), key=Refit.score)


def groupings_as_good(problem: JointProblem, base: joint.Fitted, found: Refit) -> list[Refit]:
    """Return an effect's refits in the other groupings that some shots do not tell from its own.

    They are fitted to all shots. By how much one grouping leads, a law that is wrong by a little
    may decide; which of them leaves noise it does not.
    """
    if len(scopes_of(found.effect)) < 2:
        return []
    others = partial(_regrouped, slack=CRITERIA.least_lead)
    return as_good_on_part(problem, base, found, others)


def _regrouped(
    problem: JointProblem,
    base: joint.Fitted,
    found: Refit,
    *,
    of_some: bool = True,
    slack: float = 0.0,
) -> Iterator[Refit]:
    """Yield an effect's refits in other groupings, sets of some materials if they may score most.

    Or if they may fall short of that by no more than ``slack``.
    """
    best = found
    by_material = [found] if found.effect.only is None and found.scope in KINDS else []
    groupings = list(_others(problem, found))

    def regrouped(other: tuple[Effect, str]) -> Refit:
        """Return the refit in another grouping."""
        refit = _in_grouping(*other, problem, base, found)
        own = refit.own and not found.own
        return dataclasses.replace(refit, common=found.gain) if own else refit

    for (effect, scope), other in zip(groupings, problem.each(regrouped, groupings), strict=True):
        if scope in KINDS and effect.only is None:
            by_material.append(other)
        if not other.at_bound and other.score() > best.score():
            best = other
        yield other
    # a size for each shot does not stand against one for some materials: it may be theirs, too
    least = best.score() if not best.own else max((r.score() for r in by_material), default=0.0)
    for each in by_material if of_some else []:
        yield from _of_some(problem, base, each, least - slack)


def best_grouping_from_afar(problem: JointProblem, base: joint.Fitted, found: Refit) -> Refit:
    """Return what `best_grouping` does, the groupings held against one another on a part of shots.

    Where structure is left a fit has a long way, and the right grouping leads by far. ``found``
    itself where it has no other grouping, as another base model has none.
    """
    if len(scopes_of(found.effect)) < 2:
        return found
    return better_on_part(problem, base, found, best_grouping)


def _of_some(
    problem: JointProblem, base: joint.Fitted, each: Refit, least: float
) -> Iterator[Refit]:
    """Yield an effect's refits on some materials: with a size of each, and with one of all.

    The best of the latter with a size a shot as well.
    """
    sizes = sizes_of(each, each.scope)
    if sizes is None:
        return
    count = len(sizes.names)
    price = each.price.shared / count
    some, worth = sizes.needing_own_size(price)
    if some is not None and each.score() + worth - (sizes.gain - price * count) > least:
        effect = dataclasses.replace(each.effect, only=some)
        yield _in_grouping(effect, each.scope, problem, base, each)

    def on_some(only: ActsOn) -> Refit:
        """Return the refit with one size for some materials."""
        return _on_some(only, sizes, problem, base, each)

    found = list(problem.each(on_some, _sets(each, sizes, least)))
    yield from found
    if found and "shot" in scopes_of(each.effect):
        likeliest = max(found, key=Refit.score)
        own = _in_grouping(likeliest.effect, "shot", problem, base, likeliest)
        yield dataclasses.replace(own, common=likeliest.gain)


def _sets(each: Refit, sizes: Sizes, least: float) -> list[ActsOn]:
    """Return the sets of materials that reach a score to first order from a size for each.

    The others of the right set ask for next to nothing, so that first order is near enough there.
    """
    free = each.score() + each.price.shared  # had it one number without a price
    sets = sizes.candidates(either_sign=can_be_negative(each.effect))
    return [
        only for only in sets[:SETS_FITTED] if free - (sizes.gain - sizes.promise(only)) > least
    ]


def promises_other_grouping(found: Refit) -> bool:
    """Tell whether an effect would score higher, to first order around its fit, in another.

    Of an effect that acts on some materials only the sets within these are asked: nothing was
    learned of the others. False where every shot has a size.
    """
    only = found.effect.only
    for kind in set(KINDS) & set(scopes_of(found.effect)):
        sizes = sizes_of(found, kind)
        if sizes is None:
            continue
        each = sizes.gain - CRITERIA.price_of_number * (len(sizes.names) - 1)
        sets = sizes.candidates(either_sign=can_be_negative(found.effect))
        others = [each]
        if only is not None and only.kind == kind:
            now = sizes.promise(only)
            sets = [some for some in sets if set(some.names) < set(only.names)]
        elif only is None and found.scope == kind:
            needed = sizes.needing_own_size(CRITERIA.price_of_number)[1] + CRITERIA.price_of_number
            now, others = each, [sizes.common(sizes.names)[1], needed]
        else:
            now = sizes.common(sizes.names)[1]
        if max([*others, *(sizes.promise(some) for some in sets)]) > now:
            return True
    return False


def sizes_of(found: Refit, kind: str) -> Sizes | None:
    """Return an effect's sizes on the materials of a kind, to first order around its fit.

    None where every shot has its own or the fit went nowhere. A number that is fitted by its
    logarithm counts by its value, which is neutral at zero.
    """
    at, problem, fitted = size_of(found.effect), found.problem, found.fitted
    if at is None or fitted.failed or found.effect.parameters[at].scope == "shot":
        return None
    row = problem.model.places[found.effect.id][at]
    own = problem.effect_keys(row)
    rest = [j for j, name in enumerate(problem.names) if name not in own]
    of_shot = [str(getattr(item.shot, kind)) for item in problem.shots]
    names = sorted(set(of_shot))
    blocks = []
    for block, name in zip(fitted.blocks, of_shot, strict=True):
        split = np.zeros((block.chain.shape[0], len(names)))
        split[row, names.index(name)] = 1.0
        blocks.append(dataclasses.replace(block, chain=np.hstack([block.chain[:, rest], split])))
    first = len(rest)
    precision = np.zeros((first + len(names),) * 2)
    precision[:first, :first] = problem.prior_precision[np.ix_(rest, rest)]
    none = np.zeros(len(names))
    apart = dataclasses.replace(
        problem,
        names=[
            *(problem.names[j] for j in rest),
            *(of_effect(found.effect.id, found.effect.parameters[at].name, n) for n in names),
        ],
        prior_mean=np.concatenate([problem.prior_mean[rest], none]),
        prior_precision=precision,
    )
    theta = np.concatenate([fitted.theta[rest], none])
    near = dataclasses.replace(fitted, theta=theta, blocks=blocks)
    whole, vector, _ = joint.normal_equations(apart, near)
    projection = Projection(whole, first)
    values = _values(found, row)
    now = np.array([values[[n == name for n in of_shot]].mean() for name in names])
    score, known = projection.score(vector), projection.schur
    if found.effect.parameters[at].form == "log":
        now = np.exp(now)
        score, known = score / now, known / np.outer(now, now)
    return Sizes.from_score(kind, names, score + known @ now, known)


def seen_on(effect: Effect, problem: JointProblem, fitted: joint.Fitted) -> list[ActsOn]:
    """Return the surfaces and the spheres whose own shots show that an effect acts on them.

    None of a kind of which all do that it acts on. It is taken away from the shots of one material
    at a time, and everything else follows by one step: a material shows it if the squares then rise
    by *least_lead*. A coupon too hard to yield is evidence neither for its yield nor against it.
    """
    kinds = [kind for kind in KINDS if kind in scopes_of(effect)]
    if not kinds:
        return []
    # short, and asked when the time may be over
    without = dataclasses.replace(unwatched(problem), model=problem.model.silenced(effect.id))
    silent = [
        linearise_shot(without, item, fitted.theta, own)
        for item, own in zip(problem.shots, fitted.nuisances, strict=True)
    ]
    now = joint.least_squares_nearby(problem, fitted.blocks, fitted.theta)

    def shows(kind: str, name: str) -> bool:
        """Tell whether the squares rise without the effect on a material."""
        blocks = [
            other if getattr(item.shot, kind) == name else block
            for item, block, other in zip(problem.shots, fitted.blocks, silent, strict=True)
        ]
        left = [block for block in blocks if block is not None]
        if len(left) < len(blocks):
            return True  # there is not even a contact without it
        squares = joint.least_squares_nearby(problem, left, fitted.theta)
        return squares - now >= CRITERIA.least_lead

    found = []
    for kind in kinds:
        only = effect.only
        acted = {str(getattr(item.shot, kind)) for item in problem.shots}
        if only is not None:
            acted &= set(only.names if only.kind == kind else acted)
        seen = {name for name in acted if shows(kind, name)}
        if seen and seen < acted:
            found.append(ActsOn(kind, tuple(seen)))
    return found


def _others(problem: JointProblem, found: Refit) -> Iterator[tuple[Effect, str]]:
    """Return the other groups worth a refit, those beyond some materials among them."""
    effect = found.effect
    for scope in scopes_of(effect):
        if scope != found.scope and _groups(problem, effect, scope) > 1:
            yield effect, scope
    if effect.only is not None and {effect.only.kind, "rig"} <= set(scopes_of(effect)):
        everybody = dataclasses.replace(effect, only=None)
        if _groups(problem, everybody, effect.only.kind) > 1:
            yield everybody, "rig"
            yield everybody, effect.only.kind


def _groups(problem: JointProblem, effect: Effect, scope: str) -> int:
    """Return among how many an effect's size can be shared out, of those that feel it."""
    if scope == "rig":
        return 1  # where the search began
    felt = [s.shot for s in problem.shots if effect.acts_on(s.shot.sphere, s.shot.surface)]
    return len(felt) if scope == "shot" else len({getattr(s, scope) for s in felt})


def _in_grouping(
    wanted: Effect, scope: str, problem: JointProblem, base: joint.Fitted, found: Refit
) -> Refit:
    """Return the refit with another group, started from where it is."""
    effect = rescoped(wanted, scope)
    larger, theta, nuisances = _begun(effect, problem, base, found)
    old, new = found.problem.model, larger.model
    felt = np.array([found.effect.acts_on(s.shot.sphere, s.shot.surface) for s in problem.shots])
    for parameter, at in zip(effect.parameters, new.places[effect.id], strict=True):
        before = old.names.index(of_effect(effect.id, parameter.name))
        values = _values(found, before)
        if parameter.scope == "shot":
            nuisances[:, at - len(new.shared)] = values
            continue
        keys = np.array([larger.effect_key(at, s) or "" for s in problem.shots])
        for key in larger.effect_keys(at):
            if (felt & (keys == key)).any():  # who did not feel it begins next to neutral
                theta[larger.names.index(key)] = values[felt & (keys == key)].mean()
    result = _fitted(larger, nuisances, theta)
    other = dataclasses.replace(found, effect=effect, scope=scope, problem=larger, fitted=result)
    return refitted(other, problem, base)


def _fitted(
    problem: JointProblem, nuisances: NDArray[np.float64], theta: NDArray[np.float64]
) -> joint.Fitted:
    """Return a fit from where another grouping ended; one that is far off then goes no further."""
    found = joint.fit_to_compare(problem, nuisances, theta=theta, max_iterations=STEPS_FROM_NEAR)
    samples = sum(item.expected_squares for item in problem.shots)
    if found.failed or found.converged or found.cost > joint.FAR_OFF * samples:
        return found
    return joint.fit_to_compare(problem, found.nuisances, theta=found.theta, blocks=found.blocks)


def _begun(
    effect: Effect, problem: JointProblem, base: joint.Fitted, found: Refit
) -> tuple[JointProblem, NDArray[np.float64], NDArray[np.float64]]:
    """Return the problem with another grouping of an effect, theta and nuisances as they were."""
    larger, theta, _ = extended(problem, base, effect, {})
    known = dict(zip(found.problem.names, found.fitted.theta, strict=True))
    theta = np.array([known.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    return larger, theta, carried_over(found.problem.model, larger.model, found.fitted.nuisances)


def _on_some(
    only: ActsOn, sizes: Sizes, problem: JointProblem, base: joint.Fitted, each: Refit
) -> Refit:
    """Return the refit with one size for some materials, from the fit with a size for each."""
    at = size_of(each.effect)
    effect = dataclasses.replace(rescoped(each.effect, "rig"), only=only)
    larger, theta, nuisances = _begun(effect, problem, base, each)
    model = larger.model
    felt = [only.includes(s.shot.sphere, s.shot.surface) for s in each.problem.shots]
    for place, (parameter, row) in enumerate(
        zip(effect.parameters, model.places[effect.id], strict=True)
    ):
        before = each.problem.model.names.index(of_effect(effect.id, parameter.name))
        mean = float(_values(each, before)[felt].mean())
        start = sizes.common(only.names)[0] if place == at and parameter.form != "log" else mean
        theta[larger.names.index(larger.effect_keys(row)[0])] = start
    result = _fitted(larger, nuisances, theta)
    other = dataclasses.replace(
        each, effect=effect, scope=only.kind, problem=larger, fitted=result, common=0.0
    )
    return refitted(other, problem, base)


def _values(found: Refit, at: int) -> NDArray[np.float64]:
    """Return the coordinate of one local parameter in every shot."""
    model = found.problem.model
    if at >= len(model.shared):
        return found.fitted.nuisances[:, at - len(model.shared)]
    shots = found.problem.shots
    return np.array([found.problem.shared_local(s, found.fitted.theta)[0][at] for s in shots])
