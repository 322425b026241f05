"""What is asked of a set of trials, how it is counted, and what the goal is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from drivers.simulated.effects import EFFECTS
from drivers.simulated.mistakes import MISTAKES, SINGLE_SHOT
from impactd.bench.blind.interval import median, median95, wilson95
from impactd.bench.blind.outcome import (
    claims_mistake,
    grouping_of,
    groups_right,
    is_detectable,
    names_all,
    names_effect,
    outcome,
)
from impactd.bench.blind.plan import COLOURS
from impactd.bench.blind.trial import Json, Trial
from impactd.bench.blind.visibility import VISIBLE

Group = Sequence[Trial]
Test = Callable[[Trial], bool]
Measure = Callable[[Trial], float | None]

VERDICTS = ("adequate", "identified", "family", "partial", "unknown")
"""Those of campaigns whose references are stated, as in all trials."""
LOUD = 3.0
"""Times the noise, from which no closure is kept from a threefold fall by the noise alone."""


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


def answers(trials: Group) -> list[Answer]:
    """Answer every question that there are trials for.

    Parameters
    ----------
    trials : sequence of Trial
        Of any kinds.

    Returns
    -------
    list of Answer
        In the order of the issue's acceptance.
    """
    asked = (
        _clean,
        _detection,
        _library,
        _groupings,
        _outside,
        _pairs,
        _crystal,
        _mistakes,
        _one_bad_shot,
        _repair,
        _modulus,
        _time,
    )
    return [answer for ask in asked for answer in ask(trials) if answer is not None]


def _share(question: str, group: Group, test: Test, goal: str = "") -> Answer | None:
    if not group:
        return None
    hits = sum(test(t) for t in group)
    return Answer(question, len(group), hits / len(group), *wilson95(hits, len(group)), goal=goal)


def _middle(
    question: str, group: Group, measure: Measure, goal: str = "", unit: str = "1"
) -> Answer | None:
    values = [v for v in (measure(t) for t in group) if v is not None]
    if not values:
        return None
    return Answer(question, len(values), median(values), *median95(values), unit, goal)


def _of(trials: Group, *kinds: str) -> list[Trial]:
    return [t for t in trials if t.kind in kinds]


def _shown(trials: Group, *kinds: str) -> list[Trial]:
    return [t for t in _of(trials, *kinds) if is_detectable(t)]


def _is(*wanted: str) -> Test:
    return lambda trial: outcome(trial) in wanted


def _detected(trial: Trial) -> bool:
    return trial.verdict not in ("adequate", "failed") or claims_mistake(trial)


def _clean(trials: Group) -> Iterator[Answer | None]:
    clean = _of(trials, "clean")
    proper = [t for t in clean if t.colour != "pink"]
    yield _share("clean called discrepant, white and AR(1)", proper, _detected, "<= 0.01")
    for colour, rho in COLOURS:
        own = [t for t in clean if t.colour == colour and t.ar1 == rho]
        note = f" {rho}" if rho else ", which nobody promised" if colour == "pink" else ""
        yield _share(f"- {colour}{note}", own, _detected)
    yield _share("clean, any noise: a mistake of people claimed", clean, claims_mistake, "<= 0.01")


def _detection(trials: Group) -> Iterator[Answer | None]:
    kinds = ("library", "outside", "pair")
    shown = _shown(trials, *kinds)
    yield _share("detectable effects detected", shown, _detected, ">= 0.98")
    for kind in kinds:
        yield _share(f"- {kind}", _of(shown, kind), _detected)
    singles = [t for t in _of(trials, "library", "outside") if t.visible is not None]
    faint = [t for t in singles if 0.1 <= (t.visible or 0.0) / VISIBLE < 1.0]
    yield _share("- of singles with a tenth to all of that", faint, _detected)


def _library(trials: Group) -> Iterator[Answer | None]:
    single = _shown(trials, "library")
    yield _share("library: right name or family", single, _is("right", "family"), ">= 0.95")
    right = [t for t in single if outcome(t) == "right"]
    yield _share("- right name", single, _is("right"))
    yield _share("- of these, down to the noise", right, lambda t: t.verdict == "identified")
    yield _share("library: wrong name", single, _is("wrong"), "<= 0.02")
    yield _share("library: unknown", single, _is("unknown"))


def _groupings(trials: Group) -> Iterator[Answer | None]:
    """Ask of effects that materials can have: the name, and the materials beside it."""
    single = _shown(trials, "library")
    single = [t for t in single if t.acts_on is not None and _of_materials(t)]
    question = "groupings drawn at random: right name or family"
    yield _share(question, single, _is("right", "family"), ">= 0.95")
    named = [t for t in single if set(t.truth) <= set(t.named)]
    yield _share("- named: with the right materials", named, groups_right, ">= 0.95")
    for how_many in ("one", "some", "all"):
        own = [t for t in single if grouping_of(t) == how_many]
        yield _share(f"- {how_many}: right name or family", own, _is("right", "family"))
        seen = [t for t in named if grouping_of(t) == how_many]
        yield _share(f"- {how_many}, named: with the right materials", seen, groups_right)


def _of_materials(trial: Trial) -> bool:
    return any(EFFECTS[str(e["id"])].per_material for e in trial.effects)


def _outside(trials: Group) -> Iterator[Answer | None]:
    outside = _shown(trials, "outside")
    yield _share("outside: identified", outside, lambda t: t.verdict == "identified", "<= 0")
    yield _share("- or given a family", outside, lambda t: t.verdict == "family", "<= 0")
    admitted = ("unknown", "partial")
    yield _share("outside: unknown or partial", outside, lambda t: t.verdict in admitted, ">= 0.9")
    yield _share("outside: right slot", outside, lambda t: t.slot in t.slots, ">= 0.8")
    yield _middle("outside: held-out error, before over after", outside, _fall, ">= 3")
    yield _middle("- the noise taken out of both", outside, _fall_beyond_noise)
    loud = [t for t in outside if (_over_noise("before")(t) or 0.0) >= LOUD]
    yield _middle("- where the noise leaves room for 3-fold (before >= 3 x noise)", loud, _fall)


def _pairs(trials: Group) -> Iterator[Answer | None]:
    pairs = _shown(trials, "pair")
    yield _share("pairs in two slots: both named", pairs, names_all, ">= 0.8")
    yield _share("- and nothing false", pairs, _is("right", "family"))
    yield _share("- one named, nothing false", pairs, _is("half"))
    yield _share("- a wrong name", pairs, _is("wrong"))


def _crystal(trials: Group) -> Iterator[Answer | None]:
    bare = _of(trials, "hsd")
    yield _share("base HSD: crystal found", bare, names_all, ">= 0.98")
    yield _share("- and nothing else", bare, lambda t: t.named == t.truth)


def _mistakes(trials: Group) -> Iterator[Answer | None]:
    shown = _shown(trials, "mistake")
    yield _share("mistakes detected", shown, _detected)
    yield _share("mistakes: the right kind named", shown, names_all, ">= 0.9")
    for mistake_id in MISTAKES:
        own = [t for t in shown if mistake_id in t.truth]
        yield _share(f"- {mistake_id}", own, names_all)
    named = [t for t in shown if names_all(t)]
    yield _share("- of the right kind: the right shot or group", named, groups_right, ">= 0.95")
    yield _share("- right in all", shown, _right_in_all)
    made = _of(trials, "mistake")
    yield _share("mistakes: an effect of the library named", made, names_effect, "<= 0.02")
    yield _share("- of detectable ones", shown, names_effect)
    stated = [t for t in named if t.plane.get("after") is not None]
    question = "mistakes of the right kind: 95 % interval of E/(1-nu^2) covers, after"
    yield _share(question, stated, _covers("plane", "after"), ">= 0.92")
    yield _share("- withheld", named, lambda t: t.plane.get("after") is None)
    physics = _of(trials, "library", "outside", "pair")
    yield _share("effects taken for a mistake of people", physics, claims_mistake)


def _right_in_all(trial: Trial) -> bool:
    return outcome(trial) in ("right", "family") and groups_right(trial)


def _one_bad_shot(trials: Group) -> Iterator[Answer | None]:
    """Ask what one bad shot costs in time, beside clean campaigns of the same run."""
    usual = [t.seconds for t in _of(trials, "clean") if t.seconds is not None]
    if not usual:
        return
    bad = [t for t in _of(trials, "mistake") if t.truth[0] in SINGLE_SHOT]

    def ratio(trial: Trial) -> float | None:
        """Return the time of a trial over the clean ones' median."""
        return None if trial.seconds is None else trial.seconds / median(usual)

    yield _middle("one bad shot: time to the verdict over a clean one's", bad, ratio, "<= 2")


def _repair(trials: Group) -> Iterator[Answer | None]:
    for kind, goal in (("library", "<= 1.1"), ("pair", "")):
        shown = _shown(trials, kind)
        for when in ("before", "after"):
            yield _middle(f"{kind}: held-out rms over noise, {when}", shown, _over_noise(when),
                          goal if when == "after" else "")  # fmt: skip


def _modulus(trials: Group) -> Iterator[Answer | None]:
    single = _shown(trials, "library")
    for quantity, name, goals in (
        ("plane", "E/(1-nu^2)", {"error after": "<= 0.01", "cover after": ">= 0.92"}),
        ("modulus", "E", {}),
    ):
        for when in ("before", "after"):
            question = f"library: specimen's {name}, error {when}"
            yield _middle(question, single, _error(quantity, when), goals.get(f"error {when}", ""))
        for when in ("before", "after"):
            question = f"library: 95 % interval of {name} covers, {when}"
            stated = [t for t in single if getattr(t, quantity).get(when) is not None]
            yield _share(question, stated, _covers(quantity, when), goals.get(f"cover {when}", ""))
    yield _share("library: modulus withheld after", single, lambda t: t.plane.get("after") is None)
    yield from _every_verdict(trials)


def _every_verdict(trials: Group) -> Iterator[Answer | None]:
    """Ask, of all trials, of the modulus that a verdict leaves standing."""
    stated = [t for t in trials if t.plane.get("after") is not None]
    question = "95 % interval of E/(1-nu^2) covers, whatever the verdict"
    yield _share(question, stated, _covers("plane", "after"), ">= 0.92")
    for verdict in VERDICTS:
        own = [t for t in stated if t.verdict == verdict]
        yield _share(f"- {verdict}", own, _covers("plane", "after"))


def _time(trials: Group) -> Iterator[Answer | None]:
    library = _of(trials, "library")
    for name, group, goal in (("library", library, "<= 20"), ("all", trials, "")):
        yield _middle(f"{name}: time to the verdict, median", group, lambda t: t.seconds, goal, "s")
        yield _slow(f"{name}: time to the verdict, 95 of 100 are below", group)
    yield _middle("all: processor time to the verdict", trials, lambda t: t.cpu_seconds, unit="s")
    yield _middle("all: time to write it down", trials, lambda t: t.statement_seconds, unit="s")
    yield _share("the diagnosis raised", trials, _is("failed"), "<= 0")


def _slow(question: str, group: Group) -> Answer | None:
    times = sorted(t.seconds for t in group if t.seconds is not None)
    if not times:
        return None
    top = times[math.ceil(0.95 * len(times)) - 1]
    return Answer(question, len(times), top, top, times[-1], "s")


def _over_noise(when: str) -> Measure:
    def measure(trial: Trial) -> float | None:
        held = getattr(trial, f"heldout_{when}_V")
        return float(held / trial.noise_V) if held is not None and trial.noise_V else None

    return measure


def _fall(trial: Trial) -> float | None:
    before, after = trial.heldout_before_V, trial.heldout_after_V
    return None if before is None or not after else before / after


def _fall_beyond_noise(trial: Trial) -> float | None:
    """Return the fall of the part that is not noise; infinite where none is left."""
    before, after, noise = trial.heldout_before_V, trial.heldout_after_V, trial.noise_V
    if before is None or after is None or noise is None:
        return None
    left = after**2 - noise**2
    return math.inf if left <= 0.0 else math.sqrt(max(before**2 - noise**2, 0.0) / left)


def _error(quantity: str, when: str) -> Measure:
    def measure(trial: Trial) -> float | None:
        stated: Json | None = getattr(trial, quantity).get(when)
        true = getattr(trial, f"{quantity}_true")
        return None if stated is None else abs(stated["value"] / true - 1.0)

    return measure


def _covers(quantity: str, when: str) -> Test:
    def test(trial: Trial) -> bool:
        low, high = getattr(trial, quantity)[when]["interval95"]
        return any(low <= true <= high for true in _true_values(trial, quantity))

    return test


def _true_values(trial: Trial, quantity: str) -> list[float]:
    """Return the specimen's modulus; where it was exchanged, that of either piece."""
    first = float(getattr(trial, f"{quantity}_true"))
    if trial.mistake is None or trial.mistake["id"] != "coupon_exchanged":
        return [first]
    return [first, first * float(trial.mistake["numbers"]["factor"])]
