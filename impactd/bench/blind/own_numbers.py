"""Whether an effect's own numbers hold the truth, where it was named with the right materials."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from drivers.simulated.effects import EFFECTS
from impactd.bench.blind.counting import Answer, Group
from impactd.bench.blind.interval import wilson95
from impactd.bench.blind.outcome import groups_right, names_effect, outcome
from impactd.bench.blind.trial import Trial
from impactd.demo.sealed_effects import LIBRARY_NAMES

NO_TRUTH = {
    "base_compliance": {"crystal_over_base_mass"},  # a ratio to a mass that is drawn elsewhere
    "coupon_mode": {"mass_share"},  # drawn anew for every hit
}
"""Numbers of the library that the simulator does not have as one number."""


class Stated(NamedTuple):
    """One number of one effect, and its interval.

    Attributes
    ----------
    true, low, high : float
        In the unit of both.
    """

    effect: str
    number: str
    true: float
    low: float
    high: float

    @property
    def holds(self) -> bool:
        """Whether the interval holds the truth."""
        return self.low <= self.true <= self.high


def stated_numbers(trial: Trial) -> list[Stated]:
    """Return the numbers that a diagnosis states with an interval and the simulator has.

    Returns
    -------
    list of Stated
        Empty where an effect is named that does not act or on other materials, and of an effect
        that was drawn with another law than the analysis has: its numbers mean something else.
    """
    if trial.mistake is not None or not trial.numbers or not names_effect(trial):
        return []
    if outcome(trial) != "right" or not groups_right(trial):
        return []
    said = dict(zip(trial.named, trial.numbers, strict=True))
    found = []
    for effect in trial.effects:
        kind = EFFECTS[str(effect["id"])]
        if effect.get("form", "") not in (kind.form_on("closed"), ""):
            continue
        true = {LIBRARY_NAMES.get((kind.id, n), n): x for n, x in effect["parameters"].items()}
        for name, number in said.get(kind.id, {}).items():
            quantity = name.partition("[")[0]
            if quantity in true and number.get("interval95"):
                low, high = number["interval95"]  # null is no limit
                ends = (-math.inf if low is None else low, math.inf if high is None else high)
                found.append(Stated(kind.id, quantity, float(true[quantity]), *ends))
    return found


def of_own_numbers(trials: Group) -> Iterator[Answer | None]:
    """Ask of an effect named rightly on the right materials whether its own numbers hold."""
    stated = [one for trial in trials for one in stated_numbers(trial)]
    for effect in (None, *sorted({one.effect for one in stated})):
        own = [one.holds for one in stated if effect in (None, one.effect)]
        if own:
            question = "an effect's own numbers: 95 % interval covers"
            low, high = wilson95(sum(own), len(own))
            yield Answer(
                question if effect is None else f"- {effect}", len(own), sum(own) / len(own),
                low, high, goal=">= 0.92" if effect is None else "",
            )  # fmt: skip
