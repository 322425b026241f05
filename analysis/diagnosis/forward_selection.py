"""Forward selection: add effects until only noise is left or nothing improves the model.

A first effect that takes up most is usually right where one effect acts. Where two act, each large,
the one that takes up most may be neither; so a few first effects get a second one each before
the search gives up.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence

from analysis.diagnosis.backward_elimination import (
    held_against_unfinished,
    revised,
    without_needless,
)
from analysis.diagnosis.basis.proposals import Proposal, proposals
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.one_material import (
    can_be_one_materials,
    explains_all,
    single_materials,
    split_by_material,
    tried_alone,
    without_each_material,
)
from analysis.diagnosis.progress import BudgetSpentError, MethodStep, Progress, Watch
from analysis.diagnosis.selection import MAX_EFFECTS, Selection, Step
from analysis.diagnosis.successive_halving import PresentModel, one_form_each, rank, ranked
from analysis.fit import joint
from analysis.fit.problem import JointProblem

FIRSTS_TRIED = 2
"""First effects that get a second one before the search gives up."""


def try_effects(
    step: Step, usual: joint.Fitted, progress: Progress, earlier: Sequence[Refit] = ()
) -> None:
    """Fill in what library effects bring on top of a step, as far as the time goes.

    What an earlier turn fitted on top of less says where to look first.
    """
    found: list[Refit] = []
    try:
        _compare(_present(step, usual, earlier), step, progress, found)
    except BudgetSpentError:
        step.unfinished = True
        raise
    finally:
        step.compared = True
        step.refits += one_form_each(sorted(found, key=rank))


def _present(step: Step, usual: joint.Fitted, earlier: Sequence[Refit]) -> PresentModel:
    before = {r.effect_id: r for r in earlier}
    return PresentModel(step.problem, step.fitted, usual, before)


def _compare(present: PresentModel, step: Step, progress: Progress, found: list[Refit]) -> None:
    """Fit library effects on top of a step, each into ``found`` once it is fitted to all shots."""
    tried: list[Proposal]
    tried, step.refused = proposals(step.problem)
    first = not step.problem.model.effects
    at = MethodStep.CANDIDATES if first else MethodStep.ON_TOP
    progress(at.told("does one material make the difference?"), 0.0)
    step.without = without_each_material(present)
    for apart in single_materials(present, step.without):
        found += tried_alone(apart, present, progress, first=first)
        found.sort(key=rank)
        if found and explains_all(found[0], present):
            return
        if found and _ends_in_noise(found[0]):
            # else what shows on one material's shots may act on others, hidden in their moduli
            tried = [p for p in tried if not can_be_one_materials(p.effect)]
            break
    whole: list[Refit] = []
    try:
        found += ranked(present, tried, progress, first=first, whole=whole)
    except BudgetSpentError:
        found += whole
        raise


def _ends_in_noise(found: Refit) -> bool:
    return found.usable and not Step(found.problem, found.fitted).structured


def useful(step: Step) -> list[Refit]:
    """Return the refits of a step that may be taken, best first.

    Where none leads by *least_lead*, one that is likelier than the model without it will do if it
    leaves noise: the score test has refuted that model.
    """
    usable = [r for r in step.refits if r.usable and r.score() > 0.0]
    leading = [r for r in usable if r.score() >= CRITERIA.least_lead]
    return leading or [r for r in usable[:1] if _ends_in_noise(r)]


def select(
    start: Selection,
    usual: joint.Fitted,
    progress: Progress,
    reached: list[Selection] | None = None,
) -> Selection:
    """Search for effects on top of where a selection stands.

    The first that ends in noise, fewest effects first; else the best that was found. ``usual`` is
    the base model at what was known before any record. ``reached`` is filled on the way: what is
    left where the time is over before the end.
    """
    found: list[Selection] = [] if reached is None else reached
    if not start.last.compared:
        try_effects(start.last, usual, progress)
    for way in _ways(start, usual, progress):
        found.append(way)
        # two laws that may both be wrong take up much: others are tried before they are believed
        if way.settled or (way.adequate and len(way.chosen) == len(start.chosen) + 1):
            return way
    ways = [t for t in found if t.adequate]
    if not ways:  # which names stand is then asked of what was compared with all others
        compared = [t for t in found if all(step.compared for step in t.steps[:-1])]
        return min(compared, key=lambda t: t.score, default=start)
    return min(ways, key=lambda t: t.score)


def _ways(start: Selection, usual: joint.Fitted, progress: Progress) -> Iterator[Selection]:
    """Yield selections from where one stands, the likeliest first.

    The best effect alone, then with others on top; two of which one is one material's; then from
    the second-best effect.
    """
    firsts = useful(start.last)[:FIRSTS_TRIED]
    firsts = [f for f in firsts if f.gain >= CRITERIA.little * firsts[0].gain]
    for first in firsts[:1]:
        yield from _from_first(start, first, usual, progress)
    apart = _split_by_material(start, usual, progress)
    if apart is not None:
        yield apart
    for first in firsts[1:]:
        yield from _from_first(start, first, usual, progress)


def _from_first(
    start: Selection, first: Refit, usual: joint.Fitted, progress: Progress
) -> Iterator[Selection]:
    """Yield a selection with a first effect, then with others on top of it."""
    progress(MethodStep.COMPARE.told(f"forms and groupings of {first.effect_id}"), 0.9)
    one = start.on(first)
    yield one
    if len(start.chosen) + 2 <= MAX_EFFECTS:
        yield from _continued(start, one, usual, progress)


def _split_by_material(
    start: Selection, usual: joint.Fitted, progress: Progress
) -> Selection | None:
    """Return a selection of two effects of which one is one material's, None without."""

    def alone(
        problem: JointProblem, fitted: joint.Fitted, place: joint.Fitted, told: Progress
    ) -> Refit | None:
        some = Selection([Step(problem, fitted)], [])
        if some.adequate:
            return None  # then that material makes all the difference, and was tried alone
        try_effects(some.last, place, told, start.last.refits)
        for first in useful(some.last)[:FIRSTS_TRIED]:
            one = some.on(first)
            # a part of the shots tells less of a law that may be wrong
            if one.settled:
                return one.chosen[-1]
        return None

    present = _present(start.last, usual, start.last.refits)
    found = split_by_material(present, start.last.without, alone, progress)
    if found is None:
        return None
    first, seconds = found
    step = Step(first.problem, first.fitted, refits=seconds, compared=True)
    selection = Selection([*start.steps, step], [*start.chosen, first])
    for second in useful(step)[:1]:
        longer = selection.on(second)
        return longer if longer.needs_last else None
    return None


def _continued(
    start: Selection, selection: Selection, usual: joint.Fitted, progress: Progress
) -> Iterator[Selection]:
    """Yield a selection with a second effect, and with a third where nearly nothing is left.

    Each with the others asked again beside the new one. A third must stand, unless it has made one
    of these needless.
    """
    longer = _with_another(selection, usual, progress)
    if longer is selection:
        return
    yield longer
    progress(MethodStep.ON_TOP.told("forms and groupings of the others"), 0.9)
    longer = revised(longer)
    yield longer
    grown = len(selection.chosen) < len(longer.chosen) < MAX_EFFECTS
    if longer.adequate or not grown or not _nearly(start, longer):
        return
    third = _with_another(longer, usual, progress)
    if third is longer:
        return
    third = revised(third)
    if third.stands:
        yield third


def _with_another(selection: Selection, usual: joint.Fitted, progress: Progress) -> Selection:
    """Return a selection with what helps most on top; the selection itself where nothing does."""
    if not selection.settled:
        try_effects(selection.last, usual, progress, selection.steps[-2].refits)
        for found in useful(selection.last)[:1]:
            longer = selection.on(found)
            return longer if longer.needs_last else selection
    return selection


def _nearly(start: Selection, end: Selection) -> bool:
    """Tell whether a selection has taken up so much that one more effect could be the rest."""
    samples = sum(s.item.expected_squares for s in start.last.residual.shots)
    had, left = start.last.residual.chi2 - samples, end.last.residual.chi2 - samples
    return left < CRITERIA.little * had


def searched(start: Selection, usual: joint.Fitted, progress: Watch) -> Selection:
    """Return the selection of named effects, or as much of it as the time allowed.

    Of several effects that nobody has left out again, any may be needless: only the first is kept.
    """
    reached: list[Selection] = []
    progress.searching = True
    try:
        selection = select(start, usual, progress, reached)
    except BudgetSpentError:
        selection = best_reached(start, reached)
    finally:
        progress.searching = False
    try:
        selection = without_needless(selection)
    except BudgetSpentError:
        known = len(start.chosen) + 1
        return Selection(selection.steps[: known + 1], selection.chosen[:known])
    with contextlib.suppress(BudgetSpentError):
        selection = held_against_unfinished(selection)
    return selection


def best_reached(start: Selection, reached: Sequence[Selection]) -> Selection:
    """Return the best selection that a search had found when its time was over.

    By the squares that are left, numbers paid for. It may end with an effect that was fitted to all
    shots and neither held against all others nor asked for another form or grouping.
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
    longer = selection.longer_by(further)
    # as in a whole search: what is third must leave noise with every law as it is written, or it
    # only names what the first two leave for their forms
    last = len(longer.chosen) == MAX_EFFECTS
    return longer if longer.needs_last and (longer.settled or not last) else selection
