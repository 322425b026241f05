"""The search for names as far as the time goes: what it has in hand then, and must not claim."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

from analysis.discovery.backward import behind, held_against_unfinished, without_needless
from analysis.discovery.candidates import Refit
from analysis.discovery.criteria import CRITERIA
from analysis.discovery.method_steps import Progress
from analysis.discovery.proposals import can_be_tried
from analysis.discovery.time_budget import BudgetSpentError
from analysis.discovery.trail import MAX_EFFECTS, Step, Trail, follow, look, useful
from analysis.effects.library import effect_named, library
from analysis.fit import joint


def searched(start: Trail, usual: joint.Fitted, progress: Progress) -> Trail:
    """Return the trail of named effects, or as much of it as the time allowed.

    Parameters
    ----------
    start : Trail
        Structured at its end.
    usual : Fitted
        The base model at what was known before any record.
    progress : callable
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    Trail
        Forward, then backward.
    """
    reached: list[Trail] = []
    try:
        trail = follow(start, usual, progress, reached)
    except BudgetSpentError:
        trail = best_reached(start, reached)
    with contextlib.suppress(BudgetSpentError):
        trail = without_needless(trail)
        trail = held_against_unfinished(trail)
    return trail


def best_reached(start: Trail, reached: Sequence[Trail]) -> Trail:
    """Return the best trail that a search had found when its time was over.

    Parameters
    ----------
    start : Trail
        Where the search began.
    reached : sequence of Trail
        From `follow`.

    Returns
    -------
    Trail
        By the squares that are left, numbers paid for. It may end with an effect that was fitted to
        all shots and neither held against all others nor asked for another form or grouping.
    """
    ways: list[tuple[float, Trail, Refit | None]] = []
    for trail in (start, *reached):
        ways.append((trail.score, trail, None))
        if len(trail.chosen) < MAX_EFFECTS:
            ways += [(trail.score - r.score(), trail, r) for r in useful(trail.last)[:1]]
    _, trail, further = min(ways, key=lambda way: way[0])
    if further is None:
        return trail
    ahead = look(further.problem, further.fitted)
    longer = Trail([*trail.steps, ahead], [*trail.chosen, further])
    # as in a whole search: what is third must leave noise, or it only mimics what is missing
    return trail if len(longer.chosen) == MAX_EFFECTS and not longer.adequate else longer


def not_held_against(trail: Trail) -> dict[str, list[str]]:
    """Return the names that could still stand in for those of a trail.

    Parameters
    ----------
    trail : Trail
        Ending in noise, its names not all held against others when the time was over.

    Returns
    -------
    dict
        Id to ids: those that fitted about as well, and those that nobody compared.
    """
    found = {}
    for place, taken in enumerate(trail.chosen):
        if taken.effect.replaces_base:
            continue
        step = trail.steps[place]
        others = set(_near(step, taken))
        if step.unfinished:
            others |= _never_compared(step, taken)
        elif place < len(trail.chosen) - 1:
            others |= {o for o in _can_be_tried(step) if library()[o].slot == taken.effect.slot}
        others -= {c.owner for c in trail.chosen}
        if others:
            found[taken.owner] = sorted(others)
    return found


def _near(step: Step, taken: Refit) -> Iterator[str]:
    """Yield what is near enough an effect to be confused with it, or has not come to its end."""
    yield from (e.id for e in effect_named(taken.owner).lookalikes)
    for one in step.refits:
        if one.at_bound or one.owner == taken.owner:
            continue
        open_end = CRITERIA.stepwise.unfinished_within * (not one.fitted.converged)
        if behind(taken, one) < max(CRITERIA.stepwise.confusable_within, open_end) or (
            one.effect.slot == taken.effect.slot
            and not one.on_all_shots
            and one.gain > CRITERIA.stepwise.partly_fitted_share * taken.gain
        ):
            yield one.owner


def _never_compared(step: Step, taken: Refit) -> set[str]:
    """Return the effects that were not fitted to all shots where another was taken."""
    present = {e.id.partition(":")[0] for e in step.problem.model.effects}
    fitted = {r.owner for r in step.refits if r.on_all_shots}
    return set(_can_be_tried(step)) - present - fitted - {taken.owner}


def _can_be_tried(step: Step) -> Iterator[str]:
    for owner, effect in library().items():
        if not effect.by_name and can_be_tried(effect, step.problem) is None:
            yield owner
