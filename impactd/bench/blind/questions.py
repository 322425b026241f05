"""The questions about a set of trials, their counts and their goals."""

from __future__ import annotations

import math
from collections.abc import Iterator

from drivers.simulated.effects import EFFECTS
from impactd.aliases import Json
from impactd.bench.blind.counting import (
    Answer,
    Group,
    Measure,
    covers,
    detectable,
    ended_as,
    middle,
    of_kinds,
    share,
    was_detected,
)
from impactd.bench.blind.mistake_questions import of_mistakes
from impactd.bench.blind.outcome import (
    claims_mistake,
    grouping_of,
    groups_right,
    names_all,
    outcome,
    shown_rightly,
)
from impactd.bench.blind.own_numbers import of_own_numbers
from impactd.bench.blind.plan import COLOURS
from impactd.bench.blind.trial import Trial
from impactd.bench.blind.visibility import VISIBLE

VERDICTS = ("adequate", "identified", "family", "partial", "unknown")
"""Those of campaigns whose references are stated, as in all trials."""
LOUD = 3.0
"""Times the noise, from which no closure is kept from a threefold fall by the noise alone."""


def answers(trials: Group) -> list[Answer]:
    """Answer every question that there are trials for.

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
        _forms,
        _outside,
        _pairs,
        _crystal,
        of_mistakes,
        _repair,
        _modulus,
        of_own_numbers,
        _time,
    )
    return [answer for ask in asked for answer in ask(trials) if answer is not None]


def _clean(trials: Group) -> Iterator[Answer | None]:
    clean = of_kinds(trials, "clean")
    proper = [t for t in clean if t.colour != "pink"]
    yield share("clean called discrepant, white and AR(1)", proper, was_detected, "<= 0.01")
    for colour, rho in COLOURS:
        own = [t for t in clean if t.colour == colour and t.ar1 == rho]
        note = f" {rho}" if rho else ", which nobody promised" if colour == "pink" else ""
        yield share(f"- {colour}{note}", own, was_detected)
    yield share("clean, any noise: a mistake of people claimed", clean, claims_mistake, "<= 0.01")


def _detection(trials: Group) -> Iterator[Answer | None]:
    kinds = ("library", "outside", "pair", "form")
    shown = detectable(trials, *kinds)
    yield share("detectable effects detected", shown, was_detected, ">= 0.98")
    for kind in kinds:
        yield share(f"- {kind}", of_kinds(shown, kind), was_detected)
    singles = [t for t in of_kinds(trials, "library", "outside") if t.visible is not None]
    faint = [t for t in singles if 0.1 <= (t.visible or 0.0) / VISIBLE < 1.0]
    yield share("- of singles with a tenth to all of that", faint, was_detected)


def _library(trials: Group) -> Iterator[Answer | None]:
    single = detectable(trials, "library")
    yield share("library: right name or family", single, ended_as("right", "family"), ">= 0.95")
    right = [t for t in single if outcome(t) == "right"]
    yield share("- right name", single, ended_as("right"))
    yield share("- of these, down to the noise", right, lambda t: t.verdict == "identified")
    yield share("library: wrong name", single, ended_as("wrong"), "<= 0.02")
    yield share("library: unknown", single, ended_as("unknown"))


def _groupings(trials: Group) -> Iterator[Answer | None]:
    """Ask of effects that materials can have: the name, and the materials beside it."""
    single = detectable(trials, "library")
    single = [t for t in single if t.acts_on is not None and _of_materials(t)]
    question = "groupings drawn at random: right name or family"
    yield share(question, single, ended_as("right", "family"), ">= 0.95")
    named = [t for t in single if set(t.truth) <= set(t.named)]
    yield share("- named: with the right materials", named, groups_right, ">= 0.95")
    question = "- named: what is said of the materials is true"
    yield share(question, [t for t in named if t.seen_on is not None], shown_rightly, ">= 0.95")
    for how_many in ("one", "some", "all"):
        own = [t for t in single if grouping_of(t) == how_many]
        yield share(f"- {how_many}: right name or family", own, ended_as("right", "family"))
        seen = [t for t in named if grouping_of(t) == how_many]
        yield share(f"- {how_many}, named: with the right materials", seen, groups_right)


def _of_materials(trial: Trial) -> bool:
    return any(EFFECTS[str(e["id"])].per_material for e in trial.effects)


def _forms(trials: Group) -> Iterator[Answer | None]:
    """Ask of effects whose law has another published form than in the other kinds of trial."""
    other = detectable(trials, "form")
    question = "forms left out: right name or family"
    yield share(question, other, ended_as("right", "family"), ">= 0.9")
    yield share("- wrong name", other, ended_as("wrong"), "<= 0.02")
    yield share("- down to the noise", other, lambda t: t.verdict in ("identified", "family"))
    for law in sorted({_law(t) for t in other}):
        own = [t for t in other if _law(t) == law]
        yield share(f"- {law}", own, ended_as("right", "family"))


def _law(trial: Trial) -> str:
    return f"{trial.effects[0]['id']}, {trial.effects[0]['form']}"


def _outside(trials: Group) -> Iterator[Answer | None]:
    outside = detectable(trials, "outside")
    yield share("outside: identified", outside, lambda t: t.verdict == "identified", "<= 0")
    yield share("- or given a family", outside, lambda t: t.verdict == "family", "<= 0")
    admitted = ("unknown", "partial")
    yield share("outside: unknown or partial", outside, lambda t: t.verdict in admitted, ">= 0.9")
    yield share("outside: right slot", outside, lambda t: t.slot in t.slots, ">= 0.8")
    yield share("- or among those named", outside, _slot_is_among_those_named)
    yield middle("outside: held-out error, before over after", outside, _fall, ">= 3")
    yield middle("- the noise taken out of both", outside, _fall_beyond_noise)
    loud = [t for t in outside if (_over_noise("before")(t) or 0.0) >= LOUD]
    yield middle("- where the noise leaves room for 3-fold (before >= 3 x noise)", loud, _fall)


def _slot_is_among_those_named(trial: Trial) -> bool:
    return not {trial.slot, *trial.also_slots}.isdisjoint(trial.slots)


def _pairs(trials: Group) -> Iterator[Answer | None]:
    pairs = detectable(trials, "pair")
    yield share("pairs in two slots: both named", pairs, names_all, ">= 0.8")
    yield share("- and nothing false", pairs, ended_as("right", "family"))
    yield share("- one named, nothing false", pairs, ended_as("half"))
    yield share("- a wrong name", pairs, ended_as("wrong"))


def _crystal(trials: Group) -> Iterator[Answer | None]:
    bare = of_kinds(trials, "hsd")
    yield share("base HSD: crystal found", bare, names_all, ">= 0.98")
    yield share("- and nothing else", bare, lambda t: t.named == t.truth)


def _repair(trials: Group) -> Iterator[Answer | None]:
    for kind, goal in (("library", "<= 1.1"), ("pair", "")):
        shown = detectable(trials, kind)
        for when in ("before", "after"):
            yield middle(f"{kind}: held-out rms over noise, {when}", shown, _over_noise(when),
                          goal if when == "after" else "")  # fmt: skip


def _modulus(trials: Group) -> Iterator[Answer | None]:
    single = detectable(trials, "library")
    for quantity, name, goals in (
        ("plane", "E/(1-nu^2)", {"error after": "<= 0.01", "cover after": ">= 0.92"}),
        ("modulus", "E", {}),
    ):
        for when in ("before", "after"):
            question = f"library: specimen's {name}, error {when}"
            yield middle(question, single, _error(quantity, when), goals.get(f"error {when}", ""))
        for when in ("before", "after"):
            question = f"library: 95 % interval of {name} covers, {when}"
            stated = [t for t in single if getattr(t, quantity).get(when) is not None]
            yield share(question, stated, covers(quantity, when), goals.get(f"cover {when}", ""))
    yield share("library: modulus withheld after", single, lambda t: t.plane.get("after") is None)
    yield from _every_verdict(trials)


def _every_verdict(trials: Group) -> Iterator[Answer | None]:
    """Ask, of all trials, of the modulus that a verdict leaves standing."""
    stated = [t for t in trials if t.plane.get("after") is not None]
    question = "95 % interval of E/(1-nu^2) covers, whatever the verdict"
    yield share(question, stated, covers("plane", "after"), ">= 0.92")
    for verdict in VERDICTS:
        own = [t for t in stated if t.verdict == verdict]
        yield share(f"- {verdict}", own, covers("plane", "after"))


def _time(trials: Group) -> Iterator[Answer | None]:
    library = of_kinds(trials, "library")
    for name, group, goals in (
        ("library", library, ("", "")),
        ("all", trials, ("<= 5", "<= 20")),
    ):
        median, slow = goals
        question = f"{name}: time to the verdict, median"
        yield middle(question, group, lambda t: t.seconds, median, "s")
        yield _slow(f"{name}: time to the verdict, 95 of 100 are below", group, slow)
    yield _slow("all: time to the verdict, all are below", trials, "<= 60", below=1.0)
    yield share("- ended by the budget", trials, lambda t: t.ended_early)
    yield middle("all: processor time to the verdict", trials, lambda t: t.cpu_seconds, unit="s")
    yield middle("all: time to write it down", trials, lambda t: t.statement_seconds, unit="s")
    yield share("the diagnosis raised", trials, ended_as("failed"), "<= 0")


def _slow(question: str, group: Group, goal: str = "", *, below: float = 0.95) -> Answer | None:
    times = sorted(t.seconds for t in group if t.seconds is not None)
    if not times:
        return None
    top = times[math.ceil(below * len(times)) - 1]
    return Answer(question, len(times), top, top, times[-1], "s", goal)


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
