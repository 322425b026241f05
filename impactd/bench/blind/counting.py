"""Counting of trials: rows of the table, their trials, shares and medians."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from impactd.bench.blind.interval import median, median95, wilson95
from impactd.bench.blind.outcome import claims_mistake, is_detectable, outcome
from impactd.bench.blind.trial import Trial

Group = Sequence[Trial]
Test = Callable[[Trial], bool]
Measure = Callable[[Trial], float | None]


@dataclass(frozen=True)
class Answer:
    """One row of the table.

    Attributes
    ----------
    question : str
        In words.
    count : int
        Trials that were asked.
    value, low, high : float
        Share or median, and its 95 % interval.
    unit : str
        ``1`` or ``s``.
    goal : str
        E.g. ``>= 0.98``; empty where none was set.
    """

    question: str
    count: int
    value: float
    low: float
    high: float
    unit: str = "1"
    goal: str = ""

    @property
    def met(self) -> bool | None:
        """Return whether the measured value meets the goal, None without one."""
        if not self.goal:
            return None
        sign, limit = self.goal.split()
        return self.value >= float(limit) if sign == ">=" else self.value <= float(limit)


def share(question: str, group: Group, test: Test, goal: str = "") -> Answer | None:
    """Return the share of trials that pass a test.

    Parameters
    ----------
    question : str
        In words.
    goal : str
        As in `Answer`.

    Returns
    -------
    Answer or None
        With Wilson's interval; None where nobody is asked.
    """
    if not group:
        return None
    hits = sum(test(t) for t in group)
    return Answer(question, len(group), hits / len(group), *wilson95(hits, len(group)), goal=goal)


def middle(
    question: str, group: Group, measure: Measure, goal: str = "", unit: str = "1"
) -> Answer | None:
    """Return the median of a measure.

    Parameters
    ----------
    question : str
        In words.
    measure : callable
        Of one trial, None where it has none.
    goal, unit : str
        As in `Answer`.

    Returns
    -------
    Answer or None
        None where no trial has any.
    """
    values = [v for v in (measure(t) for t in group) if v is not None]
    if not values:
        return None
    return Answer(question, len(values), median(values), *median95(values), unit, goal)


def of_kinds(trials: Group, *kinds: str) -> list[Trial]:
    """Return the trials of some kinds."""
    return [t for t in trials if t.kind in kinds]


def detectable(trials: Group, *kinds: str) -> list[Trial]:
    """Return the trials of some kinds in which all that acts can be detected."""
    return [t for t in of_kinds(trials, *kinds) if is_detectable(t)]


def ended_as(*wanted: str) -> Test:
    """Return a test for some outcomes."""
    return lambda trial: outcome(trial) in wanted


def was_detected(trial: Trial) -> bool:
    """Return whether a diagnosis saw anything, right or wrong."""
    return trial.verdict not in ("adequate", "failed") or claims_mistake(trial)


def covers(quantity: str, when: str) -> Test:
    """Return a test whether a modulus' 95 % interval holds the truth.

    Parameters
    ----------
    quantity : str
        ``modulus`` or ``plane``.
    when : str
        ``before`` or ``after``; a trial that withholds it must not be asked.

    Returns
    -------
    callable
        Where the specimen was exchanged, either piece's modulus will do: the document states one.
    """

    def test(trial: Trial) -> bool:
        """Return whether a trial's interval holds the truth."""
        low, high = getattr(trial, quantity)[when]["interval95"]
        return any(low <= true <= high for true in _true_values(trial, quantity))

    return test


def _true_values(trial: Trial, quantity: str) -> list[float]:
    """Return the specimen's modulus; where it was exchanged, that of either piece."""
    first = float(getattr(trial, f"{quantity}_true"))
    if trial.mistake is None or trial.mistake["id"] != "coupon_exchanged":
        return [first]
    return [first, first * float(trial.mistake["numbers"]["factor"])]
