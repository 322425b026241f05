"""Trials as a Markdown table, a table of effects, and a confusion matrix."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence

from drivers.simulated.mistakes import MISTAKES
from impactd.aliases import Json
from impactd.bench.blind.counting import Answer
from impactd.bench.blind.interval import median
from impactd.bench.blind.outcome import (
    could_also_be,
    groups_right,
    is_detectable,
    names_all,
    outcome,
)
from impactd.bench.blind.questions import answers
from impactd.bench.blind.trial import Trial

MATRIX_FORMAT = "impactd-blind-confusion/1"


def table(trials: Sequence[Trial]) -> str:
    """Return everything counted, as Markdown.

    Returns
    -------
    str
        Which seeds, the questions with their goals, one row an effect, and one a mistake where
        any was made.
    """
    simulated = _simulated(trials)
    parts = [_seeds(trials), _questions(simulated), _effects(simulated)]
    if any(trial.mistake is not None for trial in simulated):
        parts.append(_mistakes(simulated))
    return "\n\n".join(parts)


def _seeds(trials: Sequence[Trial]) -> str:
    by_kind: dict[str, list[int]] = defaultdict(list)
    for trial in trials:
        by_kind[trial.kind].append(trial.seed)
    parts = [f"{k} {len(s)} (seeds {min(s)} to {max(s)})" for k, s in sorted(by_kind.items())]
    said = f"{len(trials)} campaigns: {', '.join(parts)}."
    missing = len(trials) - len(_simulated(trials))
    return f"{said} Not simulated and not counted: {missing}." if missing else said


def _simulated(trials: Sequence[Trial]) -> list[Trial]:
    return [trial for trial in trials if trial.was_simulated]


def _questions(trials: Sequence[Trial]) -> str:
    lines = ["| asked | of | measured | 95 % interval | goal | |", "|---|---|---|---|---|---|"]
    for a in answers(trials):
        met = {None: "", True: "met", False: "MISSED"}[a.met]
        value, low, high = (_shown(x, a) for x in (a.value, a.low, a.high))
        lines.append(f"| {a.question} | {a.count} | {value} | {low} .. {high} | {a.goal} | {met} |")
    return "\n".join(lines)


def _shown(value: float, answer: Answer) -> str:
    return f"{value:.3g}{' s' if answer.unit == 's' else ''}"


_COLUMNS = ("right", "family", "wrong", "unknown", "missed", "failed")


def _effects(trials: Sequence[Trial]) -> str:
    """Return one row a single effect; its outcomes are those of detectable draws."""
    groups: dict[str, list[Trial]] = defaultdict(list)
    for trial in trials:
        if trial.kind in ("library", "outside"):
            groups[trial.truth[0]].append(trial)
    head = ["effect", "slot", "drawn", "detectable", "detected", *_COLUMNS, "right slot", "squares"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for name in sorted(groups, key=lambda n: (n.startswith("x_"), n)):
        drawn = groups[name]
        shown = [t for t in drawn if is_detectable(t)]
        found = Counter(outcome(t) for t in shown)
        seen = len(shown) - found["missed"] - found["failed"]
        slots = sum(t.slot in t.slots for t in shown)
        sizes = [t.visible for t in drawn if t.visible is not None]
        middle = f"{median(sizes):.2g}" if sizes else "-"
        cells = [name, drawn[0].slots[0], len(drawn), len(shown), seen]
        cells += [found[column] or "" for column in _COLUMNS] + [slots, middle]
        lines.append(f"| {' | '.join(str(c) for c in cells)} |")
    return "\n".join(lines)


def _mistakes(trials: Sequence[Trial]) -> str:
    """Return one row a mistake; outcomes are those of detectable draws."""
    outcomes = ("right", "family", "half", "wrong", "unknown", "missed", "failed")
    head = ["mistake", "drawn", "detectable", "named", "right place", *outcomes, "squares"]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for name in MISTAKES:
        drawn = [t for t in trials if t.mistake is not None and t.mistake["id"] == name]
        if not drawn:
            continue
        shown = [t for t in drawn if is_detectable(t)]
        named = [t for t in shown if names_all(t)]
        found = Counter(outcome(t) for t in shown)
        sizes = [t.visible for t in drawn if t.visible is not None]
        cells = [name, len(drawn), len(shown), len(named), sum(map(groups_right, named))]
        cells += [found[column] or "" for column in outcomes]
        cells += [f"{median(sizes):.2g}" if sizes else "-"]
        lines.append(f"| {' | '.join(str(c) for c in cells)} |")
    return "\n".join(lines)


def confusion(trials: Sequence[Trial]) -> Json:
    """Return who was taken for whom.

    Parameters
    ----------
    trials : sequence of Trial
        Any number; singles, clean ones and the base ``hsd`` count, pairs by both names; what could
        not be simulated does not.

    Returns
    -------
    dict
        ``rows``: what acted (``none``, ids, ``a+b``); ``columns``: what was said (``adequate``,
        ``unknown``, names and ``set_aside`` joined by ``+``, those of a confusion set by ``|``);
        ``counts``: rows by
        columns, of all draws and of detectable ones; ``trials``: kind and seed per cell, so that a
        page can point at them. JSON-ready.
    """
    cells: dict[tuple[str, str], list[Trial]] = defaultdict(list)
    for trial in _simulated(trials):
        cells["+".join(sorted(trial.truth)) or "none", _said(trial)].append(trial)
    rows = sorted({row for row, _ in cells}, key=lambda n: (n != "none", n.startswith("x_"), n))
    plain = ("adequate", "unknown", "not_identifiable", "failed")
    columns = sorted({c for _, c in cells}, key=lambda n: (n not in plain, n))

    return {
        "format": MATRIX_FORMAT,
        "rows": rows,
        "columns": columns,
        "counts": {
            "all": [[len(cells.get((r, c), [])) for c in columns] for r in rows],
            "detectable": [
                [sum(map(is_detectable, cells.get((r, c), []))) for c in columns] for r in rows
            ],
        },
        "trials": {
            f"{row} -> {column}": [[t.kind, t.seed] for t in found]
            for (row, column), found in sorted(cells.items())
        },
    }


def _said(trial: Trial) -> str:
    shots = ("set_aside",) if trial.set_aside else ()
    if not trial.named:
        return "+".join(shots) or trial.verdict
    names = ("|".join((name, *sorted(could_also_be(trial, name)))) for name in trial.named)
    return "+".join((*names, *shots))
