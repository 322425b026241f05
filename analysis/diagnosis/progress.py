"""The progress of a diagnosis by the steps of METHOD.md, and its time budget.

The clock comes from the caller. It is asked before every shot that a fit of the search evaluates
(`analysis.fit.problem.JointProblem.checkpoint`). The base fit and the fits of the final statement
are not asked: without them there is no document.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from analysis.errors import ParameterOutOfRangeError
from analysis.fit.cores import ONE_CORE, Cores

if TYPE_CHECKING:  # the command line shows progress, and must not wait for the compiler
    from analysis.fit.problem import JointProblem

Progress = Callable[[str, float], None]
"""Told what is being done and a share between 0 and 1."""


class MethodStep(Enum):
    """A step of METHOD.md, under the title that it has there."""

    NOISE = "Noise"
    BASE_FIT = "Base fit"
    STRUCTURE = "Is there structure?"
    CANDIDATES = "Candidates"
    COMPARE = "Compare"
    ON_TOP = "Another effect on top?"
    VERDICT = "Verdict"
    NEXT_DROP = "What to drop next"
    HELD_OUT = "Held-out check"

    @property
    def place(self) -> int:
        """Return its place among all steps, from 1."""
        return list(MethodStep).index(self) + 1

    @property
    def heading(self) -> str:
        """Return the title with its place among all steps."""
        return f"{self.value} ({self.place} of {len(MethodStep)})"

    def told(self, what: str) -> str:
        """Return what is being done, the step's heading before it."""
        return f"{self.heading}: {what}"


def each_step(tell: Callable[[str], object]) -> Callable[[str, float | None], None]:
    """Return a ``progress`` for a diagnosis that passes on only the first words of each step.

    Parameters
    ----------
    tell : callable
        Gets one line whenever another step begins; ``print`` will do.
    """
    last_heading = ""

    def progress(text: str, share: float | None) -> None:
        """Pass a text on where its heading is another than that of the one before."""
        nonlocal last_heading
        del share
        heading = text.partition(": ")[0]
        if heading != last_heading:
            last_heading = heading
            tell(text)

    return progress


SEARCH_SHARE = 0.8
"""Of the time, for looking for names. Measured without a budget: leaving names out, holding them
against others and locating took 3 to 17 % of the whole in four diagnoses of 12 to 237 s."""


class BudgetSpentError(Exception):
    """The time of a search is over; the best model so far is kept."""


class TimeBudget:
    """Seconds that a diagnosis may search, from now on.

    Parameters
    ----------
    seconds : float
        More than 0, finite. [s]
    clock : callable
        Tells the time, e.g. ``impactd.diagnosis.working_time.working_time``. [s]

    Raises
    ------
    ParameterOutOfRangeError
        If the seconds are no positive number.
    """

    def __init__(self, seconds: float, clock: Callable[[], float]) -> None:
        if not (math.isfinite(seconds) and seconds > 0):
            raise ParameterOutOfRangeError("budget_s", seconds, "a positive number of seconds")
        self.seconds = seconds
        self._clock = clock
        self._begin = clock()

    def elapsed_s(self) -> float:
        """Return the time since the beginning. [s]"""
        return self._clock() - self._begin


@dataclass(frozen=True)
class EndedEarly:
    """When and where a diagnosis ran out of time."""

    budget_s: float
    """[s]"""
    after_s: float
    """When it first noticed. [s]"""
    doing: str
    """The step and what was being done."""
    verdict_stands: bool
    """Whether the search for names had ended by then, so that only what follows it is missing."""

    @property
    def sentence(self) -> str:
        """Return it in words for people."""
        if self.verdict_stands:
            return (
                f"The budget of {self.budget_s:.3g} s was spent when the search had ended: the "
                "verdict stands, but some errors on held-out shots or the next drop are missing."
            )
        return (
            f"This is the best verdict after {self.after_s:.3g} s of search, which had not ended: "
            f'it was at "{self.doing}".'
        )

    def to_json(self) -> dict[str, object]:
        """Return it as ``ended_early`` of a diagnosis."""
        return dataclasses.asdict(self)


class Watch:
    """Passes on what a diagnosis is doing, and ends its search when the time, if any, is over."""

    def __init__(
        self,
        progress: Progress | None = None,
        budget: TimeBudget | None = None,
        cores: Cores = ONE_CORE,
    ) -> None:
        self.cores = cores
        self.ended: EndedEarly | None = None  # set where the time was found to be over
        self.judged = False  # set once the search for names is over
        self.searching = False  # set while names are looked for, not yet held against others
        self._progress = progress
        self._budget = budget
        self._doing = ""
        self._step = MethodStep.NOISE

    def __call__(self, text: str, share: float) -> None:
        """Note and pass on what is being done, under the latest step that was begun.

        A search returns to earlier questions: that belongs to the step that it has come to.
        """
        heading, _, what = text.partition(": ")
        begun = [step for step in MethodStep if step.heading == heading]
        if begun:
            self._step = max(self._step, *begun, key=lambda step: step.place)
            text = self._step.told(what)
        self._doing = text
        if self._progress is not None:
            self._progress(text, share)

    def check(self) -> None:
        """Raise `BudgetSpentError` once the time is over.

        A search ends before the rest: what it found is worth nothing until it was held against
        less and against others.
        """
        if self._budget is None:
            return
        after_s = self._budget.elapsed_s()
        if after_s < self._budget.seconds * (SEARCH_SHARE if self.searching else 1.0):
            return
        if self.ended is None:
            self.ended = EndedEarly(self._budget.seconds, after_s, self._doing, self.judged)
        raise BudgetSpentError

    def over(self, problem: JointProblem) -> JointProblem:
        """Return a problem whose fits end when the time is over, on its own cores."""
        return dataclasses.replace(problem, checkpoint=self.check, cores=self.cores)


def unwatched(problem: JointProblem) -> JointProblem:
    """Return a problem whose fits go to their end, whatever the time."""
    return dataclasses.replace(problem, checkpoint=Watch().check)
