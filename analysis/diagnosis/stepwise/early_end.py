"""The search for names as far as the time goes: what it has in hand then, and must not claim."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

from analysis.diagnosis.basis.proposals import can_be_tried
from analysis.diagnosis.candidates.refit import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.progress import BudgetSpentError, Progress
from analysis.diagnosis.stepwise.backward import behind, held_against_unfinished, without_needless
from analysis.diagnosis.stepwise.forward import (
    MAX_EFFECTS,
    Selection,
    Step,
    make_step,
    select,
    useful,
)
from analysis.effects.library import effect_named, library
from analysis.fit import joint


def searched(start: Selection, usual: joint.Fitted, progress: Progress) -> Selection:
    """Return the selection of named effects, or as much of it as the time allowed.

    Parameters
    ----------
    start : Selection
        Structured at its end.
    usual : Fitted
        The base model at what was known before any record.
    progress : callable
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    Selection
        Forward, then backward.
    """
    reached: list[Selection] = []
    try:
        selection = select(start, usual, progress, reached)
    except BudgetSpentError:
        selection = best_reached(start, reached)
    with contextlib.suppress(BudgetSpentError):
        selection = without_needless(selection)
        selection = held_against_unfinished(selection)
    return selection


def best_reached(start: Selection, reached: Sequence[Selection]) -> Selection:
    """Return the best selection that a search had found when its time was over.

    Parameters
    ----------
    start : Selection
        Where the search began.
    reached : sequence of Selection
        From `select`.

    Returns
    -------
    Selection
        By the squares that are left, numbers paid for. It may end with an effect that was fitted to
        all shots and neither held against all others nor asked for another form or grouping.
    """
    ways: list[tuple[float, Selection, Refit | None]] = []
    for selection in (start, *reached):
        ways.append((selection.score, selection, None))
        if len(selection.chosen) < MAX_EFFECTS:
            ways += [
                (selection.score - r.score(), selection, r) for r in useful(selection.last)[:1]
            ]
    _, selection, further = min(ways, key=lambda way: way[0])
    if further is None:
        return selection
    ahead = make_step(further.problem, further.fitted)
    longer = Selection([*selection.steps, ahead], [*selection.chosen, further])
    # as in a whole search: what is third must leave noise, or it only mimics what is missing
    return selection if len(longer.chosen) == MAX_EFFECTS and not longer.adequate else longer


def not_held_against(selection: Selection) -> dict[str, list[str]]:
    """Return the names that could still stand in for those of a selection.

    Parameters
    ----------
    selection : Selection
        Ending in noise, its names not all held against others when the time was over.

    Returns
    -------
    dict
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
        elif place < len(selection.chosen) - 1:
            others |= {o for o in _can_be_tried(step) if library()[o].slot == taken.effect.slot}
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
        open_end = CRITERIA.stepwise.unfinished_within * (not one.fitted.converged)
        if behind(taken, one) < max(CRITERIA.stepwise.confusable_within, open_end) or (
            one.effect.slot == taken.effect.slot
            and not one.on_all_shots
            and one.gain > CRITERIA.stepwise.partly_fitted_share * taken.gain
        ):
            yield one.effect_id


def _never_compared(step: Step, taken: Refit) -> set[str]:
    """Return the effects that were not fitted to all shots where another was taken."""
    present = {e.id.partition(":")[0] for e in step.problem.model.effects}
    fitted = {r.effect_id for r in step.refits if r.on_all_shots}
    return set(_can_be_tried(step)) - present - fitted - {taken.effect_id}


def _can_be_tried(step: Step) -> Iterator[str]:
    for effect_id, effect in library().items():
        if not effect.by_name and can_be_tried(effect, step.problem) is None:
            yield effect_id
