"""One material's shots apart: the other shots fix the cell, its own shots fix the effect.

Where the shots of every other coupon, or of every other sphere, are plain noise under the present
model, they tell the cell and the materials that are shared as if nothing were the matter. What is
looked for then acts on one material's shots alone, from a place that it has not itself bent.

Two effects of which one is one material's are found the same way: what both do at once can look
like neither. Without the right material's shots only one effect is left, which the search finds as
if it were alone; on that material's shots it is then known.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.diagnosis.basis.proposals import can_be_tried, proposals, scopes_of
from analysis.diagnosis.candidate import KNOWN_BEFORE, Refit, extended, refitted
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forms import best_form
from analysis.diagnosis.grouping_search import best_grouping
from analysis.diagnosis.progress import MethodStep, Progress
from analysis.diagnosis.score_test import chance_of
from analysis.diagnosis.successive_halving import PresentModel, leaves_noise, rank, ranked
from analysis.effects.acts_on import ActsOn
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle
from analysis.parameters import ParameterName, of_effect

MOST_MATERIALS = 2
"""Materials that may make the difference: a sphere and a coupon that met in all odd shots."""
MOST_STEPS = 40
"""Of a fit to a part of the shots, or without an effect. Measured: the base that a rig obeys ended
within 10 steps in all 19 campaigns in which it left next to nothing. What has not ended after 40
lacks something: it is no better place to begin, and what it is without is not needless."""
FIRST_STEPS = 10
"""Of these, after which it shows what leaves least: so many those 19 took, see above. Only that is
fitted further."""
MATERIALS_TRIED = 2
"""Materials left out in turn for that, what leaves least first; each is a whole search."""
SLOTS = ("contact", "mounting")
"""Where an effect can belong to one material."""


def can_be_one_materials(effect: Effect) -> bool:
    """Tell whether an effect is done with where it was tried on one material's shots alone.

    Not where the whole rig has it, and it can hide on all other shots: a stiff tape moves their
    coupons with the crystal, as if the crystal were heavier.
    """
    return effect.slot in SLOTS and scopes_of(effect) != ("rig",)


def _can_be_felt_by_one(effect: Effect) -> bool:
    """Tell whether an effect may show on one material's shots only, as a ceiling on the highest.

    Not another law of loss, which all contacts obey.
    """
    if effect.base_dashpot is not None:
        return False
    return effect.slot in SLOTS or any(p.peak_starts for p in effect.parameters)


@dataclass(frozen=True)
class OneMaterial:
    """One material's shots, under what all the others say."""

    rest: WithoutMaterial
    """Which material, and the other shots."""
    problem: JointProblem
    fitted: joint.Fitted
    """Its shots alone; what they share with the others is known as well as those know it."""
    usual: joint.Fitted
    """The same, where the rig was before any record but for what the others tell."""


def single_materials(
    present: PresentModel, without: list[WithoutMaterial]
) -> Iterator[OneMaterial]:
    """Yield the materials without whose shots the present model leaves nothing, likeliest first.

    None where there is no such material; a sphere and a coupon where the shots of both together
    make the difference; at most `MOST_MATERIALS`.
    """
    beyond = excess(present.problem, present.fitted)
    for rest in without[:MOST_MATERIALS]:
        if rest.left > CRITERIA.nothing * beyond + chance(present.problem):
            return
        yield apart_from(present, rest, far_begin(present))


def apart_from(present: PresentModel, rest: WithoutMaterial, begin: joint.Fitted) -> OneMaterial:
    """Return one material's shots under what the rest says of all that they share."""
    part, kept = part_of_shots(present.problem, rest.places)
    start = dataclasses.replace(
        begin, theta=begin.theta[kept], nuisances=begin.nuisances[rest.places]
    )
    alone = _alone(part, start, rest.problem, rest.fitted)
    before = present.usual.theta.copy()
    for j, name in enumerate(present.problem.names[: before.size]):
        at = rest.problem.index(name)
        before[j] = before[j] if at is None else rest.fitted.theta[at]
    usual = dataclasses.replace(
        present.usual,
        theta=before[[j for j in kept if j < before.size]],
        nuisances=present.usual.nuisances[rest.places],
    )
    return OneMaterial(rest, part, alone, usual)


def _alone(
    part: JointProblem, begin: joint.Fitted, rest: JointProblem, known: joint.Fitted
) -> joint.Fitted:
    """Fit one material's shots, what they share with the rest known as well as there."""
    own = [j for j, name in enumerate(part.names) if name in rest.names]
    other = [rest.names.index(part.names[j]) for j in own]
    part.start = begin.theta.copy()
    part.prior_mean, part.prior_precision = part.prior_mean.copy(), part.prior_precision.copy()
    part.start[own] = part.prior_mean[own] = known.theta[other]
    part.prior_precision[np.ix_(own, own)] = np.linalg.inv(known.covariance[np.ix_(other, other)])
    nuisances = settle(part, part.start, begin.nuisances)
    return joint.fit_to_compare(part, nuisances, max_iterations=MOST_STEPS)


def tried_alone(
    apart: OneMaterial, present: PresentModel, progress: Progress, *, first: bool
) -> list[Refit]:
    """Return the effects that one material can have or feel, refitted where they act alone.

    The best few are fitted to all shots; the rest, behind them, explain what they would there.
    Empty where these shots have no trace under what the others say.
    """
    if apart.fitted.failed:
        return []
    inner = PresentModel(apart.problem, apart.fitted, apart.usual, present.earlier)
    tried = [
        p
        for p in proposals(apart.problem)[0]
        if _can_be_felt_by_one(p.effect) and can_be_tried(p.effect, present.problem) is None
    ]
    already = present.fitted.cost - apart.rest.fitted.cost - apart.fitted.cost
    refits = ranked(inner, tried, progress, first=first, alone=True)
    if refits and not leaves_noise(refits[0].problem, refits[0].fitted):
        near = best_form(apart.problem, apart.fitted, refits[0])
        refits[0] = best_grouping(apart.problem, apart.fitted, near, of_some=False)
    found = []
    for one in refits:
        if one.on_all_shots and one.effect.slot not in SLOTS:
            found.append(everywhere(one, apart, present.problem, present.fitted))
            continue
        if one.on_all_shots and one.effect.structure is not None:
            # light coupons hide in the crystal's mass what is below all of them alike
            under_all = everywhere(one, apart, present.problem, present.fitted)
            if explains_all(under_all, present):
                others = [r for r in refits if r is not one]
                left = [
                    dataclasses.replace(r, gain=r.gain + already, on_all_shots=False)
                    for r in others
                ]
                return sorted([under_all, *left], key=rank)
            found.append(under_all)
        if one.on_all_shots:
            found.append(on_all_shots(one, apart, present.problem, present.fitted))
        else:
            found.append(dataclasses.replace(one, gain=one.gain + already))
    return sorted(found, key=rank)


def explains_all(found: Refit, present: PresentModel) -> bool:
    """Tell whether so much was explained, down to the noise, that no other slot need be asked."""
    certain = found.usable and found.gain > CRITERIA.certain_lead
    return certain and leaves_noise(found.problem, found.fitted)


def on_all_shots(
    found: Refit, apart: OneMaterial, problem: JointProblem, fitted: joint.Fitted
) -> Refit:
    """Return an effect that was found on one material's shots as part of the whole campaign.

    The other shots do not feel the effect.
    """
    rest = apart.rest
    effect = dataclasses.replace(found.effect, only=rest.only)
    larger, theta, _ = extended(problem, fitted, effect, {})
    where = dict(zip(rest.problem.names, rest.fitted.theta, strict=True))
    for name, value in zip(found.problem.names, found.fitted.theta, strict=True):
        where.setdefault(_of_material(name, effect, rest.only.label), float(value))
    theta = np.array([where.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = _shots_own(larger, problem, fitted, apart.rest, found)
    result = joint.fit_to_compare(larger, nuisances, theta=theta, max_iterations=MOST_STEPS)
    scope = rest.only.kind if found.scope == "rig" else found.scope
    whole = dataclasses.replace(
        found, effect=effect, scope=scope, problem=larger, fitted=result, on_all_shots=True
    )
    return refitted(whole, problem, fitted)


def everywhere(
    found: Refit, apart: OneMaterial, problem: JointProblem, fitted: joint.Fitted
) -> Refit:
    """Return an effect that was found on one material's shots as one that acts on all shots.

    It begins from the cell and the sizes that the one material's shots have.
    """
    larger, theta, _ = extended(problem, fitted, found.effect, {})
    where = dict(zip(apart.rest.problem.names, apart.rest.fitted.theta, strict=True))
    where |= dict(zip(found.problem.names, found.fitted.theta, strict=True))
    theta = np.array([where.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = _shots_own(larger, problem, fitted, apart.rest, found)
    nuisances = settle(larger, theta, nuisances)
    result = joint.fit_to_compare(larger, nuisances, theta=theta, max_iterations=MOST_STEPS)
    whole = dataclasses.replace(found, problem=larger, fitted=result, on_all_shots=True)
    return refitted(whole, problem, fitted)


def _shots_own(
    larger: JointProblem,
    problem: JointProblem,
    fitted: joint.Fitted,
    rest: WithoutMaterial,
    found: Refit,
) -> Array:
    """Return every shot's own numbers from where its material was fitted. Shape (shots, p)."""
    nuisances = carried_over(problem.model, larger.model, fitted.nuisances)
    shared = [larger.model.nuisances.index(n) for n in problem.model.nuisances]
    nuisances[np.ix_(rest.others, shared)] = rest.fitted.nuisances
    nuisances[rest.places] = found.fitted.nuisances
    return nuisances


def _of_material(name: ParameterName, effect: Effect, group: str) -> ParameterName:
    """Return the name that a number of the effect has where it belongs to one material."""
    ungrouped = name.is_of(effect.id) and not name.group
    return of_effect(effect.id, name.quantity, group) if ungrouped else name


@dataclass(frozen=True)
class WithoutMaterial:
    """A campaign without one material's shots."""

    only: ActsOn
    places: list[int]
    others: list[int]
    """Its shots in the campaign, and all the others."""
    problem: JointProblem
    fitted: joint.Fitted
    """The others, under the present model."""
    left: float
    """Whitened squares of the others beyond the noise."""

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
    return chance_of(_samples(problem))


def _is_far(present: PresentModel) -> bool:
    """Tell whether slopes at the present fit mislead; else they tell the materials."""
    least = CRITERIA.far_squares_per_sample * _samples(present.problem)
    return present.fitted.cost > least


def far_begin(present: PresentModel) -> joint.Fitted:
    """Return where fits to a part of the shots begin: at the whole's best unless that is ruined."""
    if _is_far(present) and not present.problem.model.effects:
        return dataclasses.replace(present.usual, theta=present.problem.start)
    return present.fitted


def without_each_material(present: PresentModel) -> list[WithoutMaterial]:
    """Return the campaign without each material in turn, what leaves least first.

    Empty where the sizes that each material asks for to first order tell it.
    """
    if not _is_far(present):
        return []
    begin, every = far_begin(present), set(range(len(present.problem.shots)))

    def without(own: tuple[ActsOn, list[int]]) -> WithoutMaterial | None:
        """Return the campaign without a material, a few steps on; None where it cannot be."""
        only, places = own
        others = sorted(every - set(places))
        part, kept = part_of_shots(present.problem, others)
        theta = begin.theta[kept]
        nuisances = settle(part, theta, begin.nuisances[others])
        fitted = joint.fit_to_compare(
            part, nuisances, theta=theta, max_iterations=FIRST_STEPS
        )  # fmt: skip
        left = excess(part, fitted)
        return None if fitted.failed else WithoutMaterial(only, places, others, part, fitted, left)

    problem = present.problem
    tried = problem.each(without, list(_materials(problem).items()))
    found = [one for one in tried if one is not None]
    by_left, by_share = (sorted(found, key=key) for key in (_left, _left_by_share))
    asked = {one.only for one in (*by_left[:MOST_MATERIALS], *by_share[:MATERIALS_TRIED])}
    further = problem.each(_fitted_further, [one for one in found if one.only in asked])
    return sorted([*further, *(one for one in found if one.only not in asked)], key=_left)


def _left(one: WithoutMaterial) -> float:
    return one.left


def _left_by_share(one: WithoutMaterial) -> float:
    return one.left / one.share


def _fitted_further(one: WithoutMaterial) -> WithoutMaterial:
    if one.fitted.converged:
        return one
    more = MOST_STEPS - one.fitted.iterations
    fitted = joint.fit(
        one.problem, one.fitted.nuisances, theta=one.fitted.theta, max_iterations=more,
        blocks=one.fitted.blocks,
    )  # fmt: skip
    return dataclasses.replace(one, fitted=fitted, left=excess(one.problem, fitted))


def _materials(problem: JointProblem) -> dict[ActsOn, list[int]]:
    """Return the shots of every material that some shots do without."""
    found: dict[ActsOn, list[int]] = {}
    for place, item in enumerate(problem.shots):
        for kind, name in (("surface", item.shot.surface), ("sphere", item.shot.sphere)):
            if name is not None:
                found.setdefault(ActsOn(kind, (name,)), []).append(place)
    return {only: places for only, places in found.items() if len(places) < len(problem.shots)}


def part_of_shots(problem: JointProblem, places: list[int]) -> tuple[JointProblem, list[int]]:
    """Return a problem of some shots with the globals that these depend on."""
    shots = [problem.shots[at] for at in places]
    used = np.zeros(len(problem.names), dtype=bool)
    for item in shots:
        used |= problem.shared_local(item, problem.start)[1].any(axis=0)
        used[[j for j, _ in problem.inputs_of(item)]] = True
    kept = np.flatnonzero(used).tolist()
    names = [problem.names[j] for j in kept]
    part = dataclasses.replace(
        problem,
        shots=shots,
        names=names,
        inputs=tuple(one for one in problem.inputs if one.name in names),
        start=problem.start[kept],
        prior_mean=problem.prior_mean[kept],
        prior_precision=problem.prior_precision[np.ix_(kept, kept)],
    )
    return part, kept


Alone = Callable[[JointProblem, joint.Fitted, joint.Fitted, Progress], Refit | None]
"""Search one effect that leaves noise: problem, fitted, usual place, progress -> refit."""


def split_by_material(
    present: PresentModel, without: list[WithoutMaterial], alone: Alone, progress: Progress
) -> tuple[Refit, list[Refit]] | None:
    """Return a first effect, found without one material, and what then acts on that material.

    The first effect is fitted to all shots, the second ones on top of it, best first.
    """
    whole = excess(present.problem, present.fitted)
    simpler = [w for w in without if w.left < CRITERIA.half * w.share * whole]
    for rest in sorted(simpler, key=_left_by_share)[:MATERIALS_TRIED]:
        progress(MethodStep.ON_TOP.told(f"searching without {rest.only.label}"), 0.5)
        usual = _usual_of(present, rest)
        first = alone(rest.problem, rest.fitted, usual, progress)
        if first is None or can_be_tried(first.effect, present.problem) is not None:
            continue
        larger, begin = _on_all(present, rest, first)
        fitted = joint.fit_to_compare(larger, begin.nuisances, theta=begin.theta)
        if fitted.failed:
            continue
        taken = dataclasses.replace(first, problem=larger, fitted=fitted, on_all_shots=True)
        taken = refitted(taken, present.problem, present.fitted)
        known = dataclasses.replace(rest, problem=first.problem, fitted=first.fitted)
        wider = PresentModel(larger, fitted, present.usual, present.earlier)
        found = tried_alone(apart_from(wider, known, begin), wider, progress, first=True)
        if found:
            return taken, found
    return None


def _usual_of(present: PresentModel, rest: WithoutMaterial) -> joint.Fitted:
    """Return the usual place for some of the shots."""
    names = present.problem.names[: present.usual.theta.size]
    kept = [j for j, name in enumerate(names) if rest.problem.index(name) is not None]
    return dataclasses.replace(
        present.usual,
        theta=present.usual.theta[kept],
        nuisances=present.usual.nuisances[rest.others],
    )


def _on_all(
    present: PresentModel, rest: WithoutMaterial, first: Refit
) -> tuple[JointProblem, joint.Fitted]:
    """Return the whole problem with the first effect, and where its fit begins."""
    larger, theta, _ = extended(present.problem, present.fitted, first.effect, {})
    before = dict(zip(present.problem.names, present.usual.theta, strict=False))
    known = dict(zip(first.problem.names, first.fitted.theta, strict=True))
    theta = np.array(
        [known.get(n, before.get(n, v)) for n, v in zip(larger.names, theta, strict=True)]
    )
    base = present.fitted.nuisances.copy()
    base[:, : present.usual.nuisances.shape[1]] = present.usual.nuisances
    nuisances = carried_over(present.problem.model, larger.model, base)
    nuisances = settle(larger, theta, nuisances, kept=KNOWN_BEFORE)
    nuisances[rest.others] = first.fitted.nuisances
    return larger, dataclasses.replace(present.fitted, theta=theta, nuisances=nuisances)
