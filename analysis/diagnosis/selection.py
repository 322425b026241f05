"""How far a search has come: its steps, and the effects that lead from each to the next."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

from analysis.diagnosis.basis.form_error import discrepancy
from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forms import best_form
from analysis.diagnosis.grouping_search import (
    best_grouping,
    best_grouping_from_afar,
    groupings_as_good,
    promises_other_grouping,
)
from analysis.diagnosis.linearised import Linearised, linearise
from analysis.diagnosis.one_material import WithoutMaterial
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.score_test import (
    Part,
    ScoreTest,
    check_residual,
    has_clear_surplus,
    is_far_from_noise,
    run_score_test,
    shows_structure,
    takes_statements_as_exact,
)
from analysis.fit import joint
from analysis.fit.physical_range import out_of_range
from analysis.fit.problem import JointProblem

MAX_EFFECTS = 3
"""That a selection may name. A choice of time: each turn costs as much as the first. Trials draw
two at most, and a third must leave noise by its written laws (`Selection.stands`)."""

OpenNames = dict[str, list[str]]
"""By effect, the names that cannot be told from it."""


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
    on_part: Step | None = None
    """The same model on shots that stand for all, where that was asked."""
    likely: Part | None = None
    """The test that a step like this one failed most clearly: asked first, and alone."""
    compared: bool = False
    """What can be tried, or the slot of what was taken, was compared as far as the time went."""
    unfinished: bool = False
    """The time was over before all that can be tried was compared."""

    @property
    def linearised(self) -> Linearised:
        """Return the residual, linearised, with the columns of all families."""
        return self.test()[0]

    @property
    def residual(self) -> Linearised:
        """Return the same; the columns of families may be missing, which take most of its time."""
        return self._without_families if self.tested is None else self.tested[0]

    @cached_property
    def _without_families(self) -> Linearised:
        problem = unwatched(self.problem)
        inexact = discrepancy(problem, self.fitted)
        return linearise(problem, self.fitted, wanted=(), inexact=inexact)

    @property
    def score_test(self) -> ScoreTest:
        """Return what the score test says of the residual."""
        return self.test()[1]

    def test(self) -> tuple[Linearised, ScoreTest]:
        """Return both; the first time they are made, to their end whatever the time."""
        if self.tested is None:
            self.tested = check_residual(unwatched(self.problem), self.fitted)
        return self.tested

    @cached_property
    def as_written(self) -> ScoreTest:
        """Return what the score test says where every law is exactly as it is written."""
        return run_score_test(linearise(unwatched(self.problem), self.fitted))

    @property
    def structured(self) -> bool:
        """Whether the residual is more than noise. It is not tested where it is far more."""
        if self.tested is None:
            if self.is_far:
                return True
            if not takes_statements_as_exact(self.problem) and has_clear_surplus(self.residual):
                return True
            if self._fails_likely:
                return True
        return self.score_test.structured

    @cached_property
    def is_far(self) -> bool:
        """Whether so much is left that no test is needed; asked whatever the time."""
        return is_far_from_noise(unwatched(self.problem), self.fitted)

    @cached_property
    def _fails_likely(self) -> bool:
        likely = self.likely
        return likely is not None and shows_structure(unwatched(self.problem), self.fitted, likely)

    @property
    def impossible(self) -> bool:
        """Whether there is no fit, or one of its numbers is outside what it can be."""
        return self.fitted.failed or bool(out_of_range(self.problem, self.fitted))


@dataclass
class Selection:
    """Steps, and the effects that lead from each to the next."""

    steps: list[Step]
    chosen: list[Refit]
    left_open: OpenNames | None = None
    """What a part of the shots left open; None where all names are to be asked for."""

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
        """Whether it has ended in noise, and that hardly needs its laws to be wrong.

        With every law as it is written next to nothing of what any of the effects takes up is left.
        """
        last = self.last
        if not self.adequate or not last.residual.wrong_by:
            return self.adequate
        exact, least = last.as_written, min(taken.gain for taken in self.chosen)
        return not exact.structured or exact.left < CRITERIA.nothing * least

    @property
    def stands(self) -> bool:
        """Whether it has ended in noise, if it is full with every law as it is written.

        The last of as many effects as may be else only names what the others leave for their forms.
        """
        return self.settled if len(self.chosen) == MAX_EFFECTS else self.adequate

    @property
    def needs_last(self) -> bool:
        """Whether the last effect is worth its numbers where every law may be wrong by a little.

        The laws of those before it may take up what it does. Far from noise nobody asks: no law is
        wrong by so much.
        """
        before, after = self.steps[-2], self.steps[-1]
        if before.is_far:
            return True
        instead = before.residual.gain_of_inexactness - after.residual.gain_of_inexactness
        return self.chosen[-1].score() - instead > CRITERIA.least_lead

    @property
    def score(self) -> float:
        """Return the whitened squares left, numbers paid for."""
        paid = sum(r.gain - r.score() for r in self.chosen)
        return self.last.fitted.cost + paid

    def on(self, found: Refit) -> Selection:
        """Return the selection one effect further, in the form and grouping that score highest."""
        near = self.longer_by(found)
        settled = near.settled
        if settled and not promises_other_grouping(found):
            return near
        before = self.last.problem, self.last.fitted
        if settled:
            wide = best_grouping(*before, found)
        else:
            wide = best_grouping_from_afar(*before, best_form(*before, found))
        lead = wide.score() - found.score()
        taken = near
        if lead > 0.0:
            wider = self.longer_by(wide)
            # where the same effect ends in noise it needs no lead
            taken = wider if lead > CRITERIA.least_lead or wider.adequate else near
        if settled or not taken.leaves_next_to_nothing:
            return taken
        others = map(self.longer_by, groupings_as_good(*before, taken.chosen[-1]))
        return min((o for o in others if o.adequate), key=lambda o: o.score, default=taken)

    def longer_by(self, found: Refit) -> Selection:
        """Return the selection one effect further, in the form and grouping that it has."""
        return Selection([*self.steps, Step(found.problem, found.fitted)], [*self.chosen, found])

    @property
    def leaves_next_to_nothing(self) -> bool:
        """Whether structure is left, but next to nothing of what the last effect has taken up.

        So much a law that is taken as written may be wrong by, in a wrong grouping as in a right.
        """
        last = self.last
        if last.impossible or last.is_far or self.adequate:
            return False
        return last.score_test.left < CRITERIA.nothing * self.chosen[-1].gain
