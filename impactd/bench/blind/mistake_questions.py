"""The questions about trials with an operator's mistake."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.simulated.mistakes import MISTAKES, SINGLE_SHOT
from impactd.bench.blind.counting import (
    Answer,
    Group,
    covers,
    detectable,
    middle,
    of_kinds,
    share,
    was_detected,
)
from impactd.bench.blind.interval import median
from impactd.bench.blind.outcome import (
    claims_mistake,
    groups_right,
    names_all,
    names_effect,
    outcome,
)
from impactd.bench.blind.trial import Trial


def of_mistakes(trials: Group) -> Iterator[Answer | None]:
    """Ask of mistakes of people: kind and place, false names, the modulus, the time.

    Yields
    ------
    Answer or None
        None where nobody is asked.
    """
    shown = detectable(trials, "mistake")
    yield share("mistakes detected", shown, was_detected)
    yield share("mistakes: the right kind named", shown, names_all, ">= 0.9")
    for mistake_id in MISTAKES:
        own = [t for t in shown if mistake_id in t.truth]
        yield share(f"- {mistake_id}", own, names_all)
    named = [t for t in shown if names_all(t)]
    yield share("- of the right kind: the right shot or group", named, groups_right, ">= 0.95")
    yield share("- right in all", shown, _right_in_all)
    made = of_kinds(trials, "mistake")
    yield share("mistakes: an effect of the library named", made, names_effect, "<= 0.02")
    yield share("- of detectable ones", shown, names_effect)
    stated = [t for t in named if t.plane.get("after") is not None]
    question = "mistakes of the right kind: 95 % interval of E/(1-nu^2) covers, after"
    yield share(question, stated, covers("plane", "after"), ">= 0.92")
    yield share("- withheld", named, lambda t: t.plane.get("after") is None)
    physics = of_kinds(trials, "library", "outside", "pair")
    yield share("effects taken for a mistake of people", physics, claims_mistake)
    yield from _one_bad_shot(trials)


def _right_in_all(trial: Trial) -> bool:
    return outcome(trial) in ("right", "family") and groups_right(trial)


def _one_bad_shot(trials: Group) -> Iterator[Answer | None]:
    """Ask what one bad shot costs in time, beside clean campaigns of the same run."""
    usual = [t.seconds for t in of_kinds(trials, "clean") if t.seconds is not None]
    if not usual:
        return
    bad = [t for t in of_kinds(trials, "mistake") if t.truth[0] in SINGLE_SHOT]

    def ratio(trial: Trial) -> float | None:
        """Return the time of a trial over the clean ones' median."""
        return None if trial.seconds is None else trial.seconds / median(usual)

    yield middle("one bad shot: time to the verdict over a clean one's", bad, ratio, "<= 2")
