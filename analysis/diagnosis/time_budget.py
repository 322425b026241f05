"""How long a diagnosis may search, and what it was doing when that time was over.

The clock comes from the caller. It is asked before every shot that a fit of the search evaluates
(`analysis.fit.problem.JointProblem.checkpoint`). The base fit and the fits of the final statement
are not asked: without them there is no document.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

from analysis.diagnosis.method_steps import Progress
from analysis.errors import ParameterOutOfRangeError
from analysis.fit.problem import JointProblem, go_on

Json = dict[str, object]


class BudgetSpentError(Exception):
    """The time of a search is over: whoever has found something keeps it, and fits no more."""


class TimeBudget:
    """Seconds that a diagnosis may search, from now on.

    Parameters
    ----------
    seconds : float
        More than 0, finite. [s]
    clock : callable
        Tells the time, e.g. ``time.monotonic``. [s]

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
    """When and where a diagnosis ran out of time.

    Attributes
    ----------
    budget_s, after_s : float
        The time it had, and when it first noticed. [s]
    doing : str
        The step and what was being done.
    verdict_stands : bool
        Whether the search for names had ended by then, so that only what follows it is missing.
    """

    budget_s: float
    after_s: float
    doing: str
    verdict_stands: bool

    @property
    def sentence(self) -> str:
        """Return it in words for people."""
        if self.verdict_stands:
            return (
                f"The budget of {self.budget_s:.3g} s was spent when the search had ended: the "
                "verdict stands, but some errors on held-out shots or the next drop are missing."
            )
        return (
            f"This is the best verdict after {self.after_s:.3g} s; the search had not ended: it "
            f'was at "{self.doing}".'
        )

    def to_json(self) -> Json:
        """Return it as ``ended_early`` of a diagnosis."""
        return dataclasses.asdict(self)


class Watch:
    """Passes on what a diagnosis is doing, and ends its search when the time is over.

    Parameters
    ----------
    progress : callable, optional
        Told what is being done and a share between 0 and 1.
    budget : TimeBudget, optional
        Without one no search is ended.

    Attributes
    ----------
    ended : EndedEarly or None
        Set where the time was found to be over.
    judged : bool
        Set once the search for names is over.
    """

    def __init__(self, progress: Progress | None = None, budget: TimeBudget | None = None) -> None:
        self.ended: EndedEarly | None = None
        self.judged = False
        self._progress = progress
        self._budget = budget
        self._doing = ""

    def __call__(self, text: str, share: float) -> None:
        """Note and pass on what is being done."""
        self._doing = text
        if self._progress is not None:
            self._progress(text, share)

    def check(self) -> None:
        """Raise once the time is over.

        Raises
        ------
        BudgetSpentError
            From then on at every call.
        """
        if self.ended is None and self._budget is not None:
            after_s = self._budget.elapsed_s()
            if after_s < self._budget.seconds:
                return
            self.ended = EndedEarly(self._budget.seconds, after_s, self._doing, self.judged)
        if self.ended is not None:
            raise BudgetSpentError

    def over(self, problem: JointProblem) -> JointProblem:
        """Return a problem whose fits end when the time is over."""
        return dataclasses.replace(problem, checkpoint=self.check)


def unwatched(problem: JointProblem) -> JointProblem:
    """Return a problem whose fits go to their end, whatever the time."""
    return dataclasses.replace(problem, checkpoint=go_on)
