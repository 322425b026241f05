"""Forward selection: add effects until only noise is left or nothing improves the model.

A first effect that takes up most is usually right where one effect acts. Where two act, each large,
the one that takes up most may be neither; so a few first effects get a second one each before
the search gives up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from analysis.diagnosis.basis.proposals import Proposal, proposals
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forms import best_form
from analysis.diagnosis.grouping_search import (
    best_grouping,
    best_grouping_from_afar,
    promises_other_grouping,
)
from analysis.diagnosis.linearised import Linearised, linearise
from analysis.diagnosis.one_material import (
    WithoutMaterial,
    can_be_one_materials,
    explains_all,
    single_materials,
    split_by_material,
    tried_alone,
    without_each_material,
)
from analysis.diagnosis.progress import BudgetSpentError, MethodStep, Progress, unwatched
from analysis.diagnosis.score_test import (
    ScoreTest,
    check_residual,
    is_far_from_noise,
    run_score_test,
)
from analysis.diagnosis.successive_halving import PresentModel, one_form_each, rank, ranked
from analysis.fit import joint
from analysis.fit.physical_range import out_of_range
from analysis.fit.problem import JointProblem

MAX_EFFECTS = 3
FIRSTS_TRIED = 2
"""First effects that get a second one before the search gives up."""
HUM = "mains_hum"


@dataclass
class Step:
    """One step of the search."""

    problem: JointProblem
    fitted: joint.Fitted
    """The model of this turn, at its best."""
    tested: tuple[Linearised, ScoreTest] | None = None
    """The residual, linearised, and what the score test says of it; None until it is asked."""
    refits: list[Refit] = field(default_factory=list)
    """What was tried on top, best first."""
    refused: dict[str, str] = field(default_factory=dict)
    """Why other effects could not be tried."""
    without: list[WithoutMaterial] = field(default_factory=list)
    """The same model without each material's shots, where that was asked."""
    reduced: dict[str, Step | None] = field(default_factory=dict)
    """The same model without one of its effects, by the effect's id, where that was asked."""
    compared: bool = False
    """What can be tried was compared, as far as the time went."""
    unfinished: bool = False
    """The time was over before all that can be tried was compared."""

    @property
    def linearised(self) -> Linearised:
        """Return the residual, linearised."""
        return self.test()[0]

    @property
    def score_test(self) -> ScoreTest:
        """Return what the score test says of the residual."""
        return self.test()[1]

    def test(self) -> tuple[Linearised, ScoreTest]:
        """Return both; the first time they are made, to their end whatever the time."""
        if self.tested is None:
            self.tested = check_residual(unwatched(self.problem), self.fitted)
        return self.tested

    @property
    def structured(self) -> bool:
        """Whether the residual is more than noise. It is not tested where it is far more."""
        if self.tested is None and is_far_from_noise(self.problem, self.fitted):
            return True
        return self.score_test.structured

    @property
    def impossible(self) -> bool:
        """Whether one of its numbers is outside what it can be."""
        return bool(out_of_range(self.problem, self.fitted))


@dataclass
class Selection:
    """Steps, and the effects that lead from each to the next."""

    steps: list[Step]
    chosen: list[Refit]

    @property
    def last(self) -> Step:
        """Return the step that the selection has reached."""
        return self.steps[-1]

    @property
    def adequate(self) -> bool:
        """Whether the selection has ended in noise.

        A model with a number that nothing can have does not count, whatever it leaves.
        """
        return not (self.last.impossible or self.last.structured)

    @property
    def settled(self) -> bool:
        """Whether it has ended in noise with every law exactly as it is written."""
        last = self.last
        if not self.adequate or not last.linearised.wrong_by:
            return self.adequate
        return not run_score_test(linearise(unwatched(last.problem), last.fitted)).structured

    @property
    def needs_last(self) -> bool:
        """Whether the last effect is worth its numbers where every law may be wrong by a little.

        The laws of those before it may take up what it does. Far from noise nobody asks: no law is
        wrong by so much.
        """
        before, after = self.steps[-2], self.steps[-1]
        if is_far_from_noise(before.problem, before.fitted):
            return True
        instead = before.linearised.gain_of_inexactness - after.linearised.gain_of_inexactness
        return self.chosen[-1].score() - instead > CRITERIA.comparison.least_lead

    @property
    def score(self) -> float:
        """Return the whitened squares left, numbers paid for."""
        paid = sum(r.gain - r.score() for r in self.chosen)
        return self.last.fitted.cost + paid

    def on(self, found: Refit) -> Selection:
        """Return the selection one effect further, in the form and grouping that score highest."""
        step = Step(found.problem, found.fitted)
        structured = step.structured
        if structured or promises_other_grouping(found):
            before = self.last.problem, self.last.fitted
            if structured:
                wide = best_grouping_from_afar(*before, best_form(*before, found))
            else:
                wide = best_grouping(*before, found)
            lead = wide.score() - found.score()
            if lead > 0.0:
                wider = Step(wide.problem, wide.fitted)
                # where the same effect ends in noise it needs no lead
                if lead > CRITERIA.comparison.least_lead or not wider.structured:
                    found, step = wide, wider
        return Selection([*self.steps, step], [*self.chosen, found])


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
    """Return the refits of a step that may be taken, best first."""
    return [r for r in step.refits if r.usable and r.score() >= CRITERIA.comparison.least_lead]


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
    firsts = useful(start.last)
    for first in firsts[:1]:
        progress(MethodStep.COMPARE.told(f"forms and groupings of {first.effect_id}"), 0.9)
        found.append(start.on(first))
    if found and (found[0].adequate or len(start.chosen) + 2 > MAX_EFFECTS):
        return found[0]
    apart = _split_by_material(start, usual, progress)
    if apart is not None and (apart.settled or not found):
        return apart
    if not found:
        return start
    for place, first in enumerate(firsts[:FIRSTS_TRIED]):
        if first.gain < CRITERIA.stepwise.first_effect_share * firsts[0].gain:
            break
        found.append(_with_second(found[0] if place == 0 else start.on(first), usual, progress))
        # two laws that may both be wrong take up much: others are tried before they are believed
        if found[-1].settled:
            return found[-1]
    best = min([t for t in found if t.adequate] or found, key=lambda t: t.score)
    if len(best.chosen) < MAX_EFFECTS and _nearly(start, best):
        third = _with_second(best, usual, progress)
        # the third of a chain is where what the first two leave for their forms would get a name
        return third if third.settled else best
    return best


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
    step = Step(first.problem, first.fitted)
    step.refits += seconds
    selection = Selection([*start.steps, step], [*start.chosen, first])
    for second in useful(step)[:1]:
        longer = selection.on(second)
        return longer if longer.needs_last else None
    return None


def _with_second(selection: Selection, usual: joint.Fitted, progress: Progress) -> Selection:
    """Return a selection with what helps most on top; the selection itself where nothing does."""
    if not selection.settled:
        try_effects(selection.last, usual, progress, selection.steps[-2].refits)
        for found in useful(selection.last)[:1]:
            longer = selection.on(found)
            return longer if longer.needs_last else selection
    return selection


def _nearly(start: Selection, end: Selection) -> bool:
    """Tell whether a selection has taken up so much that one more effect could be the rest."""
    samples = sum(s.white.size for s in start.last.linearised.shots)
    had, left = start.last.linearised.chi2 - samples, end.last.linearised.chi2 - samples
    return left < CRITERIA.stepwise.third_effect_share * had
