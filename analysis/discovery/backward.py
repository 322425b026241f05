"""What a trail's names must stand: being left out, and every other effect of their slots.

What could stand in for an effect is seen only beside all the others that act.
"""

from __future__ import annotations

import dataclasses
import math

from analysis.discovery.candidates import Refit, continued
from analysis.discovery.criteria import CRITERIA
from analysis.discovery.ranking import lookalikes_refitted, rivals_refitted
from analysis.discovery.trail import Step, Trail, look
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.model.impact_model import ImpactModel


def without_needless(trail: Trail) -> Trail:
    """Return a trail without an effect that another has made needless.

    The last one too: it may do no more than open a way to where the one before it ends in noise.
    """
    if len(trail.chosen) < 2 or not trail.adequate:
        return trail
    for place, old in enumerate(trail.chosen):
        if old.effect.replaces_base:
            continue
        shorter = _reduced(trail.last, old.effect)
        if shorter is None or shorter.impossible:
            continue
        if shorter.fitted.cost - trail.last.fitted.cost < CRITERIA.comparison.least_lead:
            others = [c for at, c in enumerate(trail.chosen) if at != place]
            steps = [*trail.steps[: len(others)], shorter]
            gain = steps[-2].fitted.cost - shorter.fitted.cost
            others[-1] = dataclasses.replace(
                others[-1], gain=gain, problem=shorter.problem, fitted=shorter.fitted
            )
            return held_against_others(Trail(steps, others))
    return trail


def held_against_unfinished(trail: Trail) -> Trail:
    """Return a trail whose last effect has stood against what was given up half-way.

    Parameters
    ----------
    trail : Trail
        Any.

    Returns
    -------
    Trail
        As `held_against_others` returns it, for others of its slot that a part of the shots spoke
        for and that were never fitted to all.
    """
    if not trail.chosen or not trail.adequate:
        return trail
    step, taken = trail.steps[-2], trail.chosen[-1]
    owners = {
        r.owner
        for r in step.refits
        if r.effect.slot == taken.effect.slot
        and not (r.on_all_shots or r.at_bound)
        and r.gain > CRITERIA.stepwise.partly_fitted_share * taken.gain
    }
    return held_against_others(trail, owners - {taken.owner}) if owners else trail


def held_against_others(trail: Trail, owners: set[str] | None = None) -> Trail:
    """Return a trail whose last effect has stood against every other of its slot.

    An effect that was found beside one that has since been taken off was never compared with what
    else could do the work alone.

    Parameters
    ----------
    trail : Trail
        Ending in noise.
    owners : set of str, optional
        Only these others.

    Returns
    -------
    Trail
        With the others among the refits of the last turn; one that does better takes its place.
    """
    step, taken = trail.steps[-2], trail.chosen[-1]
    others = rivals_refitted(step.problem, step.fitted, taken, owners)
    new = {o.owner for o in others}
    step.refits[:] = [*others, *(r for r in step.refits if r.owner not in new)]
    best = max(others, key=lambda r: r.score(), default=taken)
    if best.at_bound or best.score() <= taken.score():
        return trail
    ahead = Trail(trail.steps[:-1], trail.chosen[:-1]).on(best)
    if not ahead.adequate:
        return trail
    step.refits.append(taken)
    return ahead


def each_held_against_others(trail: Trail) -> tuple[Trail, dict[str, list[Refit]]]:
    """Return a trail of which every effect has stood against others, and what they leave open.

    What could stand in for an effect is seen only beside all the others that act, and at its turn
    not all of them were known yet: each is taken as if it had been the last.

    Parameters
    ----------
    trail : Trail
        Ending in noise.

    Returns
    -------
    trail : Trail
        The same, or one in another order, of which another effect has taken a place.
    near : dict
        Id to the refits that the data cannot tell from it, without those that have none.
    """
    near = _rivals(trail)
    for taken in [c for c in trail.chosen[:-1] if not c.effect.replaces_base]:
        turned = _as_last(trail, taken)
        if turned is None:
            continue
        held = held_against_others(turned)
        if held.chosen[-1].owner != turned.chosen[-1].owner:
            trail = held
            near = {owner: found for owner, found in near.items() if owner != taken.owner}
        near |= _rivals(held)
    return trail, near


def _as_last(trail: Trail, taken: Refit) -> Trail | None:
    """Return a trail with the same end, one of its effects found last; None where it cannot be."""
    others = [c for c in trail.chosen if c is not taken]
    shorter = _reduced(trail.last, taken.effect)
    if shorter is None:
        return None
    last = trail.last
    gain = shorter.fitted.cost - last.fitted.cost
    moved = dataclasses.replace(taken, gain=gain, problem=last.problem, fitted=last.fitted)
    return Trail([*trail.steps[: len(others)], shorter, last], [*others, moved])


def _reduced(step: Step, left_out: Effect) -> Step | None:
    """Return a step's model without an effect, fitted again; None where it cannot be."""
    kept = tuple(e for e in step.problem.model.effects if e.id != left_out.id)
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
    fitted = joint.fit(problem, nuisances, theta=problem.start)
    return look(problem, fitted) if fitted.blocks else None


def _is_effect(name: str, model: ImpactModel) -> bool:
    return any(name.startswith(f"{e.id}.") for e in model.effects)


def behind(taken: Refit, other: Refit) -> float:
    """Return by how many squares another effect falls short, in gain or with its numbers paid.

    Parameters
    ----------
    taken, other : Refit
        On top of the same model.

    Returns
    -------
    float
        The lesser of the two; infinite where it was not fitted to all shots. [1]
    """
    if other.owner == taken.owner or not other.on_all_shots:
        return math.inf
    return min(
        taken.score() - other.score(),
        taken.gain - other.gain,
    )


def _rivals(trail: Trail) -> dict[str, list[Refit]]:
    """Return what the data cannot tell from the last effect of a trail, under its id if anything.

    It is fitted on where it is close behind, and where that does not come to an end it is near as
    long as it draws nearer: along a bent valley every step is small, and the way is long.
    """
    step, taken = trail.steps[-2], trail.chosen[-1]
    step.refits += lookalikes_refitted(step.problem, step.fitted, taken)
    near = []
    for at, one in enumerate(step.refits):
        within = CRITERIA.stepwise.confusable_within
        if behind(taken, one) < CRITERIA.stepwise.unfinished_within and not one.fitted.converged:
            step.refits[at] = further = continued(step.fitted, one)
            if not further.fitted.converged:
                within += CRITERIA.stepwise.unfinished_growth * (further.gain - one.gain)
        if not step.refits[at].at_bound and behind(taken, step.refits[at]) < within:
            near.append(step.refits[at])
    return {taken.owner: near} if near else {}
