"""Backward elimination: leave each effect out, and compare it with the others of its slot.

What could stand in for an effect is seen only beside all the others that act, and so are its form
and its grouping. Where the time is over before that, what nobody asked stays open.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

from analysis.diagnosis.basis.form_error import discrepancy
from analysis.diagnosis.basis.proposals import can_be_tried
from analysis.diagnosis.candidate import Refit, continued
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forms import forms_as_good
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.one_material import MOST_STEPS
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.selection import OpenNames, Selection, Step
from analysis.diagnosis.successive_halving import (
    MORE,
    lookalikes_refitted,
    rivals_refitted,
    thinned,
)
from analysis.effects.effect import Effect
from analysis.effects.library import effect_named, library
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.settle import settle
from analysis.model.impact_model import ImpactModel
from analysis.parameters import ParameterName


def without_needless(selection: Selection) -> Selection:
    """Return a selection without an effect that another has made needless.

    Without it the model leaves noise: the search would have ended there. The last one too: it may
    do no more than open a way to where the one before it ends in noise.
    """
    if len(selection.chosen) < 2 or not selection.adequate:
        return selection
    for place, old in enumerate(selection.chosen):
        if old.effect.replaces_base:
            continue
        shorter = _reduced(selection.last, old.effect)
        if shorter is None or shorter.impossible:
            continue
        lost = shorter.fitted.cost - selection.last.fitted.cost
        if lost < CRITERIA.least_lead or not shorter.structured:
            others = [c for at, c in enumerate(selection.chosen) if at != place]
            steps = [*selection.steps[: len(others)], shorter]
            gain = steps[-2].fitted.cost - shorter.fitted.cost
            others[-1] = dataclasses.replace(
                others[-1], gain=gain, problem=shorter.problem, fitted=shorter.fitted
            )
            return held_against_others(Selection(steps, others))
    return selection


def revised(selection: Selection) -> Selection:
    """Return a selection whose earlier effects were asked again beside its last one.

    At its turn an effect took up what belonged to those that came later, in a form and a grouping
    that did so best. One that is now worth less than its numbers goes; another form or grouping is
    taken where it leads.
    """
    for taken in [c for c in selection.chosen[:-1] if not c.effect.replaces_base]:
        if selection.settled:
            break
        turned = _as_last(selection, taken)
        if turned is None:
            continue
        beside, now = Selection(turned.steps[:-1], turned.chosen[:-1]), turned.chosen[-1]
        needless = now.score() <= CRITERIA.least_lead
        if needless and not beside.last.impossible:
            selection = _as_last(beside, beside.chosen[-1]) or beside
            continue
        again = beside.on(now)
        selection = turned if again.chosen[-1] is now else again
    return selection


def held_against_unfinished(selection: Selection) -> Selection:
    """Return a selection whose last effect has stood against what was given up half-way.

    Those are others of its slot that a part of the shots spoke for and that were never fitted to
    all.
    """
    if not selection.chosen or not selection.adequate:
        return selection
    step, taken = selection.steps[-2], selection.chosen[-1]
    effect_ids = {
        r.effect_id
        for r in step.refits
        if r.effect.slot == taken.effect.slot
        and not (r.on_all_shots or r.at_bound)
        and r.gain > CRITERIA.half * taken.gain
    }
    return (
        held_against_others(selection, effect_ids - {taken.effect_id}) if effect_ids else selection
    )


def held_against_others(selection: Selection, effect_ids: set[str] | None = None) -> Selection:
    """Return a selection whose last effect has stood against others, by default all of its slot.

    An effect that was found beside one that has since been taken off was never compared with what
    else could do the work alone. The others go among the refits of the last turn; one that does
    better takes its place.
    """
    step, taken = selection.steps[-2], selection.chosen[-1]
    others = rivals_refitted(step.problem, step.fitted, taken, effect_ids)
    new = {o.effect_id for o in others}
    step.refits[:] = [*others, *(r for r in step.refits if r.effect_id not in new)]
    step.compared |= effect_ids is None
    best = max(others, key=lambda r: r.score(), default=taken)
    if best.at_bound or best.score() <= taken.score():
        return selection
    ahead = Selection(selection.steps[:-1], selection.chosen[:-1]).on(best)
    if not ahead.adequate:
        return selection
    step.refits.append(taken)
    return ahead


def each_held_against_others(selection: Selection) -> tuple[Selection, dict[str, list[Refit]]]:
    """Return a selection of which every effect has stood against others, and what they leave open.

    What could stand in for an effect is seen only beside all the others that act, and at its turn
    not all of them were known yet: each is taken as if it had been the last. Returns the selection,
    in which another effect may have taken a place, and by id the refits that the data cannot tell
    from it. Where some of the shots were asked before, only what these left open is asked.
    """
    left_open = selection.left_open

    def others_of(taken: Refit) -> set[str] | None:
        """Return the names to hold against one; None for all that could stand in for it."""
        return None if left_open is None else set(left_open.get(taken.effect_id, ()))

    turns = dict(zip([c.effect_id for c in selection.chosen], selection.steps, strict=False))
    before, asked = selection.steps[-2], others_of(selection.chosen[-1])
    if asked is not None:
        asked -= {r.effect_id for r in before.refits if r.on_all_shots}
    elif before.compared:
        asked = set()
    if asked is None or asked:
        selection = held_against_others(selection, asked)
    near = _rivals(selection)
    for taken in [c for c in selection.chosen[:-1] if not c.effect.replaces_base]:
        asked = others_of(taken)
        turned = _as_last(selection, taken) if asked is None or asked else None
        if turned is None:
            continue
        if asked is None:
            asked = _could_stand_in(turns[taken.effect_id], taken)
            asked -= {c.effect_id for c in selection.chosen}
        held = held_against_others(turned, asked)
        if held.chosen[-1].effect_id != turned.chosen[-1].effect_id:
            selection = held
            near = {
                effect_id: found
                for effect_id, found in near.items()
                if effect_id != taken.effect_id
            }
        near |= _rivals(held)
    return selection, near


def _could_stand_in(turn: Step, taken: Refit) -> set[str]:
    """Return the names of an effect's slot, and of any that explained half as much at its turn."""
    most = CRITERIA.half * max((r.gain for r in turn.refits if not r.at_bound), default=0.0)
    near = {r.effect_id for r in turn.refits if not r.at_bound and r.gain > most}
    return near | _of_its_slot(turn, taken)


def forms_not_told_apart(selection: Selection) -> dict[str, list[Refit]]:
    """Return by effect the other forms of its law that the data do not tell from the one taken."""
    found = {}
    for taken in selection.chosen:
        if taken.effect.replaces_base:
            continue
        last = taken is selection.chosen[-1]
        turned = selection if last else _as_last(selection, taken)
        if turned is not None:
            step = turned.steps[-2]
            forms = forms_as_good(step.problem, step.fitted, turned.chosen[-1])
            if forms:
                found[taken.effect_id] = forms
    return found


def _as_last(selection: Selection, taken: Refit) -> Selection | None:
    """Return a selection with the same end, one effect found last; None where it cannot be."""
    others = [c for c in selection.chosen if c is not taken]
    shorter = _reduced(selection.last, taken.effect)
    if shorter is None:
        return None
    last = selection.last
    gain = shorter.fitted.cost - last.fitted.cost
    moved = dataclasses.replace(taken, gain=gain, problem=last.problem, fitted=last.fitted)
    return Selection([*selection.steps[: len(others)], shorter, last], [*others, moved])


def steps_in_order(selection: Selection) -> list[Step]:
    """Return a selection's steps, each with the effects that were chosen up to it and no other.

    Of three effects that were asked again in another order, an earlier step still has those of the
    old one: it is fitted again, whatever the time. It stays where that cannot be. What was tried
    at a turn is with the selection's own steps.
    """
    found = [selection.last]
    earlier = reversed(selection.steps[:-1])
    for step, taken in zip(earlier, reversed(selection.chosen), strict=True):
        ahead = found[0].problem.model.effects
        rest = {e.id for e in ahead if e.id != taken.effect.id}
        if {e.id for e in step.problem.model.effects} != rest:
            untimed = Step(unwatched(found[0].problem), found[0].fitted)
            found.insert(0, _reduced(untimed, taken.effect) or step)
        else:
            found.insert(0, step)
    return found


def _reduced(step: Step, dropped: Effect) -> Step | None:
    """Return a step's model without an effect, fitted again; None where it cannot be."""
    if dropped.id not in step.reduced:
        step.reduced[dropped.id] = _fitted_without(step, dropped)
    return step.reduced[dropped.id]


def _fitted_without(step: Step, dropped: Effect) -> Step | None:
    """Return a step's model without an effect, fitted as far as it comes near the shots.

    To a part of them first: no fit that came near was hopeless for so many steps. What is hopeless
    there is needed, and how hopeless makes no difference.
    """
    kept = tuple(e for e in step.problem.model.effects if e.id != dropped.id)
    model = dataclasses.replace(step.problem.model, effects=kept)
    keep = [
        j
        for j, name in enumerate(step.problem.names)
        if not _is_effect(name, step.problem.model) or _is_effect(name, model)
    ]
    problem = dataclasses.replace(
        step.problem,
        model=model,
        names=[step.problem.names[j] for j in keep],
        start=step.fitted.theta[keep],
        prior_mean=step.problem.prior_mean[keep],
        prior_precision=step.problem.prior_precision[keep][:, keep],
    )
    nuisances = carried_over(step.problem.model, model, step.fitted.nuisances)
    places = thinned(problem, MORE)
    few = problem.with_shots(places)
    part = joint.fit_to_compare(few, nuisances[places], max_iterations=joint.CREEP_STEPS)
    if part.failed:
        return None
    nuisances[places] = part.nuisances
    steps = MOST_STEPS
    if joint.is_hopeless(few, part.cost):
        nuisances, steps = settle(problem, part.theta, nuisances), 0
    fitted = joint.fit_to_compare(problem, nuisances, theta=part.theta, max_iterations=steps)
    return None if fitted.failed else Step(problem, fitted)


def _is_effect(name: ParameterName, model: ImpactModel) -> bool:
    return any(name.is_of(e.id) for e in model.effects)


def behind(taken: Refit, other: Refit) -> float:
    """Return by how many squares another effect falls short, in gain or with its numbers paid.

    Infinite where the other was not fitted to all shots. [1]
    """
    if other.effect_id == taken.effect_id or not other.on_all_shots:
        return math.inf
    return min(
        taken.score() - other.score(),
        taken.gain - other.gain,
    )


def _score_of_inexact(refit: Refit) -> float:
    """Return twice the rise of ln Z by an effect whose law, like all others, may be wrong."""
    problem, fitted = refit.problem, refit.fitted
    inexact = None if joint.is_hopeless(problem, fitted.cost) else discrepancy(problem, fitted)
    if inexact is None:
        return refit.score()
    found = linearise(problem, fitted, wanted=(), inexact=inexact)
    return refit.score() + found.gain_of_inexactness


def _rivals(selection: Selection) -> dict[str, list[Refit]]:
    """Return what the data cannot tell from the last effect chosen, under its id if anything.

    Two may be near as their laws are written, or where both may be wrong by a little: what tells
    one form of a law from another does not tell the laws. A rival
    is fitted on where it is close behind, and where that does not come to an end it is near as
    long as it draws nearer: along a bent valley every step is small, and the way is long.
    """
    step, taken = selection.steps[-2], selection.chosen[-1]
    step.refits += lookalikes_refitted(step.problem, step.fitted, taken)
    score = taken.score() + selection.last.residual.gain_of_inexactness
    near = []
    for at, one in enumerate(step.refits):
        within = CRITERIA.least_lead
        if behind(taken, one) < CRITERIA.clear_lead and not one.fitted.converged:
            step.refits[at] = further = continued(step.fitted, one)
            if not further.fitted.converged:
                within += CRITERIA.twice * (further.gain - one.gain)
        other = step.refits[at]
        if other.at_bound or other.effect_id == taken.effect_id or not other.on_all_shots:
            continue
        if behind(taken, other) < within or score - _score_of_inexact(other) < within:
            near.append(other)
    return {taken.effect_id: near} if near else {}


def not_held_against(selection: Selection) -> OpenNames:
    """Return the names that could still stand in for those of a selection.

    Id to ids: those that fitted about as well, and those that nobody compared.
    """
    found = {}
    for place, taken in enumerate(selection.chosen):
        if taken.effect.replaces_base:
            continue
        step = selection.steps[place]
        others = set(_near(step, taken))
        if step.unfinished:
            others |= _never_compared(step, taken)
        elif place < len(selection.chosen) - 1 or not step.compared:
            others |= _of_its_slot(step, taken)
        others -= {c.effect_id for c in selection.chosen}
        if others:
            found[taken.effect_id] = sorted(others)
    return found


def _near(step: Step, taken: Refit) -> Iterator[str]:
    """Yield what is near enough an effect to be confused with it, or has not come to its end."""
    yield from (e.id for e in effect_named(taken.effect_id).lookalikes)
    for one in step.refits:
        if one.at_bound or one.effect_id == taken.effect_id:
            continue
        open_end = CRITERIA.clear_lead * (not one.fitted.converged)
        if behind(taken, one) < max(CRITERIA.least_lead, open_end) or (
            one.effect.slot == taken.effect.slot
            and not one.on_all_shots
            and one.gain > CRITERIA.half * taken.gain
        ):
            yield one.effect_id


def _never_compared(step: Step, taken: Refit) -> set[str]:
    """Return the effects that were not fitted to all shots where another was taken."""
    present = {e.id.partition(":")[0] for e in step.problem.model.effects}
    fitted = {r.effect_id for r in step.refits if r.on_all_shots}
    return set(_can_be_tried(step)) - present - fitted - {taken.effect_id}


def _of_its_slot(step: Step, taken: Refit) -> set[str]:
    return {o for o in _can_be_tried(step) if library()[o].slot == taken.effect.slot}


def _can_be_tried(step: Step) -> Iterator[str]:
    for effect_id, effect in library().items():
        if not effect.by_name and can_be_tried(effect, step.problem) is None:
            yield effect_id
