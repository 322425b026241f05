"""The search for names on a part of the shots, and what it finds carried to all of them.

Repeats of a drop say the same about a model's form: what a third of the shots tells apart, all of
them tell apart by three times as much. So names are searched for on shots that stand for all. What
was found is then fitted to all shots and must leave noise there; only names that the part left open
are compared once more.
"""

from __future__ import annotations

import contextlib
import dataclasses
from dataclasses import dataclass

from analysis.diagnosis.backward_elimination import (
    each_held_against_others,
    held_against_others,
    not_held_against,
    revised,
    steps_in_order,
)
from analysis.diagnosis.candidate import Refit, continued, refitted
from analysis.diagnosis.forward_selection import searched, try_effects, useful
from analysis.diagnosis.progress import BudgetSpentError, MethodStep, Watch, unwatched
from analysis.diagnosis.selection import MAX_EFFECTS, OpenNames, Selection, Step
from analysis.diagnosis.successive_halving import (
    MORE,
    few_show_much,
    on_all,
    part_of,
    scaled,
    thinned,
)
from analysis.fit import joint
from analysis.fit.problem import JointProblem

LEAST_SAVING = 2
"""Times the part's shots that a campaign must have for the part to be searched. A choice of time:
with fewer, the fit of what was found to all shots takes up what the search has saved."""


def searched_on_part(start: Selection, usual: joint.Fitted, progress: Watch) -> Selection:
    """Return the selection of named effects on all shots, or as much of it as the time allowed.

    ``usual`` is the base model at what was known before any record. All shots are searched where
    the part shows too little, and on top of what it has named where they show more. What the best
    names leave of the part in plenty, none of all shots explain.
    """
    last = start.last
    places = thinned(last.problem, MORE)
    enough = not last.compared and few_show_much(last.problem, last.fitted)
    begin = _begin_on_part(start, places) if enough else None
    if begin is None:
        return searched(start, usual, progress)
    found = searched(begin, _usual_of(usual, places), progress)
    left_open: OpenNames = {}
    if found.adequate:
        found, left_open = _held(found, progress)
    whole = _on_all_shots(found, start, places, left_open)
    beyond_names = not found.adequate and few_show_much(found.last.problem, found.last.fitted)
    if beyond_names or whole.stands or progress.ended is not None:
        return whole
    whole = _held_on_all_shots(whole)
    if whole.stands:
        return whole
    if len(whole.chosen) == MAX_EFFECTS:
        return Selection(whole.steps[:-1], whole.chosen[:-1])
    return searched(whole, usual, progress)


def no_effect_explains_part(start: Selection, usual: joint.Fitted, progress: Watch) -> bool:
    """Tell whether the best effect leaves structure of a part of the shots: then of all as well.

    What each effect explains there is filled in, scaled to all shots. False where the part shows
    noise, or too little for any effect to lead, or is not worth a search.
    """
    places = thinned(start.last.problem, MORE)
    begin = _begin_on_part(start, places)
    if begin is None:
        return False
    try_effects(begin.last, _usual_of(usual, places), progress)
    best = useful(begin.last)[:1]
    if not best or begin.on(best[0]).adequate:
        return False
    _fill_in(start.last, begin.last, places, [])
    return True


def best_on_part(start: Selection, usual: joint.Fitted, progress: Watch) -> tuple[bool, float]:
    """Return whether the best effect leaves noise of a part of the shots, and -2 ln Z with it.

    All shots are asked of a campaign that has few. -2 ln Z is up to a constant of the shots.
    """
    begin = tried_on_part(start, usual, progress)
    best = useful(begin.last)[:1]
    if not best:
        return False, begin.last.fitted.cost
    after = begin.on(best[0])
    return after.adequate, after.last.fitted.cost + best[0].gain - best[0].score()


def tried_on_part(start: Selection, usual: joint.Fitted, progress: Watch) -> Selection:
    """Return a selection with its effects tried, on a part of the shots if there are many."""
    places = thinned(start.last.problem, MORE)
    begin, place = _begin_on_part(start, places), _usual_of(usual, places)
    if begin is None:
        begin, place = start, usual
    if not begin.last.compared:
        try_effects(begin.last, place, progress)
    return begin


def left_open_on_part(selection: Selection, progress: Watch) -> OpenNames | None:
    """Return the names that a part of the shots cannot tell from those of a selection on all.

    None where no part is worth it, or the time is over.
    """
    problem = selection.last.problem
    places = thinned(problem, MORE)
    if not _is_worth_it(problem, places):
        return None
    steps = [_on_part(one, places) for one in selection.steps]
    chosen = []
    for taken, before, after in zip(selection.chosen, steps[:-1], steps[1:], strict=True):
        known = dataclasses.replace(taken, problem=after.problem, fitted=after.fitted)
        if not taken.effect.replaces_base:  # that is held against nothing
            known = refitted(known, before.problem, before.fitted)
        chosen.append(known)
    left_open = _held(Selection(steps, chosen), progress)[1]
    return left_open if progress.ended is None else None


def _is_worth_it(problem: JointProblem, places: list[int]) -> bool:
    return len(problem.shots) >= LEAST_SAVING * len(places)


def _begin_on_part(start: Selection, places: list[int]) -> Selection | None:
    """Return a selection on a part of the shots; None where that shows noise or saves no time.

    It ends in the same step whenever it is asked, with all that was tried on top.
    """
    last = start.last
    if not _is_worth_it(last.problem, places):
        return None
    if last.on_part is None:
        last.on_part = _on_part(last, places)
    begin = Selection([*start.steps[:-1], last.on_part], start.chosen)
    return None if begin.adequate else begin


def _usual_of(usual: joint.Fitted, places: list[int]) -> joint.Fitted:
    return dataclasses.replace(usual, nuisances=usual.nuisances[places])


def _on_part(step: Step, places: list[int]) -> Step:
    """Return a step with the same model fitted to some of its shots, whatever the time."""
    few, fitted = part_of(unwatched(step.problem), step.fitted, places)
    watched = dataclasses.replace(few, checkpoint=step.problem.checkpoint)
    return Step(watched, fitted, compared=step.compared)


def _held(found: Selection, progress: Watch) -> tuple[Selection, OpenNames]:
    """Return a selection with its names held against others, and the names that stay open."""
    progress(MethodStep.ON_TOP.told("holding every name against others"), 0.9)
    near: dict[str, list[Refit]] = {}
    with contextlib.suppress(BudgetSpentError):
        found, near = each_held_against_others(found)
    left_open = {} if progress.ended is None else not_held_against(found)
    for taken, rivals in near.items():
        names = {*left_open.get(taken, ()), *(r.effect_id for r in rivals)}
        left_open[taken] = sorted(names)
    return found, left_open


@dataclass(frozen=True)
class _Carried:
    """Takes refits from a part of the shots to all of them, whatever the time."""

    places: list[int]
    part: Step
    """The model that they extend, on the part."""
    whole: Step
    """The same on all shots."""

    def on_all_shots(self, found: Refit) -> Refit:
        """Return a refit on all shots."""
        part = self.places, self.part.fitted
        moved = on_all(found, unwatched(self.whole.problem), self.whole.fitted, part)
        watched = dataclasses.replace(moved.problem, checkpoint=self.whole.problem.checkpoint)
        return dataclasses.replace(moved, problem=watched)

    def to_its_end(self, found: Refit) -> Refit:
        """Return a refit on all shots, as far as it goes in the time that is left."""
        moved = self.on_all_shots(found)
        if moved.fitted.converged:
            return moved
        with contextlib.suppress(BudgetSpentError):
            return continued(self.whole.fitted, moved)
        return moved


def _on_all_shots(
    found: Selection, start: Selection, places: list[int], left_open: OpenNames
) -> Selection:
    """Return a selection that was found on a part of the shots, fitted to all of them.

    What the part cannot tell from its last effect is fitted to all as well.
    """
    last = len(found.chosen) - 1
    selection = Selection(list(start.steps), list(start.chosen), left_open)
    in_order = steps_in_order(found)
    for at in range(len(start.chosen), len(found.chosen) + 1):
        part, step = found.steps[at], selection.last
        carried = _Carried(places, in_order[at], step)
        names = left_open.get(found.chosen[at].effect_id, ()) if at == last else ()
        near = [one for one in part.refits if one.effect_id in names]
        _fill_in(step, part, places, list(step.problem.each(carried.to_its_end, near)))
        if at <= last:
            after = in_order[at + 1]
            taken = carried.on_all_shots(
                dataclasses.replace(found.chosen[at], problem=after.problem, fitted=after.fitted)
            )
            ahead = Step(taken.problem, taken.fitted)
            selection = Selection([*selection.steps, ahead], [*selection.chosen, taken], left_open)
    return selection


def _fill_in(step: Step, part: Step, places: list[int], whole: list[Refit]) -> None:
    """Give a step what was tried on a part of its shots, some of it refitted on all."""
    factor, names = len(step.problem.shots) / len(places), {one.effect_id for one in whole}
    step.refits = [
        *whole,
        *(scaled(one, factor) for one in part.refits if one.effect_id not in names),
    ]
    step.refused, step.compared, step.unfinished = part.refused, part.compared, part.unfinished


def _held_on_all_shots(selection: Selection) -> Selection:
    """Return a selection whose last effect stands on all shots, in another form or name if need be.

    A part of the shots may have left open which one it is.
    """
    left_open = selection.left_open or {}
    with contextlib.suppress(BudgetSpentError):
        before = Selection(selection.steps[:-1], selection.chosen[:-1])
        selection = revised(before.on(selection.chosen[-1]))
        names = left_open.get(selection.chosen[-1].effect_id)
        if names:
            selection = held_against_others(selection, set(names))
    return selection
