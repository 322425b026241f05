"""The choice of discrepancies to fit, and of the best one on held-out shots.

They are chosen on shots that stand for all, and the best is then learned on all: repetitions of a
drop say the same about which one it is, and each takes seconds.
"""

from __future__ import annotations

import contextlib
import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from analysis.diagnosis.basis.families import Scale
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.fit import FORCE, Learned, Part, learn, learn_force, on_top
from analysis.diagnosis.held_out import heldout_or_none
from analysis.diagnosis.linearised import Linearised
from analysis.diagnosis.progress import BudgetSpentError, MethodStep, Progress, unwatched
from analysis.diagnosis.selection import Step
from analysis.diagnosis.successive_halving import MORE, part_of, thinned

FORCES = ("elastic", "rate")
FORCED = ("contact", "loss")
"""Families that stand for a free contact force."""
ALSO = {"locked": "outline", "wander": "pieces"}
"""What is learned where a family explains much that has too many numbers, or too coarse ones."""
REFINED = {
    "curve": ("fine", "ripple"),
    "response": ("impulse",),
    "creep": ("impulse",),
    "mode": ("damped",),
    "pieces": ("jump", "slew"),
}
"""Tried as well where something is left, as they cost more."""
SAME_GROUPS = ("damped", "jump")
"""Finer forms with the groups of the coarse one; the others are the rig's."""
LEARNABLE: tuple[Part, ...] = (
    *((f, "rig") for f in ("response", "creep", "curve", "path", "droop", "dynamic", "seat",
                           "contact", "loss", "mode")),
    *((f, "surface") for f in ("response", "creep", "curve", "path", "seat", "contact", "loss",
                               "mode", "pitch", "gain")),
    *((f, "sphere") for f in ("response", "path", "contact", "loss", "gain")),
    *((f, "shot") for f in ("stiffness", "gain", "pitch", "cell", "swing", "clock", "mode",
                            "wander")),
    *((f, "drift") for f in ("stiffness", "gain", "pitch")),
    ("stiffness", "sphere drift"), ("stiffness", "surface drift"),
    ("locked", "pair"),
)  # fmt: skip
BEYOND_FIRST_ORDER: tuple[Part, ...] = (
    ("slew", "rig"), ("jump", "shot"), ("ripple", "rig"), ("warmth", "rig"), ("blow", "shot"),
    ("alternate", "shot"),
)  # fmt: skip
"""Tried first where there is much to explain: no first order says beforehand what these would
explain, each is learned within seconds, and few things but its own look like it."""
LAST: tuple[Part, ...] = (("impulse", "rig"),)
"""Tried where much is left after all others."""
MOST_LEARNED = 3
"""Kinds that are fitted, for the time that each takes. Chosen by trial."""


def best_discrepancy(
    step: Step,
    linearised: Linearised,
    gains: Mapping[Part, float],
    before: float | None,
    progress: Progress,
) -> Learned | None:
    """Return the discrepancy that repairs held-out shots best, or a few together where needed.

    None where none repairs them, as where speeds only contradict their heights; where the time is
    over the best of those learned by then. ``gains`` say what each family explains to first order,
    coefficients paid for, ``linearised`` knows the tuned frequencies, and ``before`` is the
    present model's error on held-out shots. [unit of the signal]
    """
    places = thinned(step.problem, MORE)
    if len(places) == len(step.problem.shots):
        return _best_by_now(_Trials(step, linearised.scale), gains, before, progress)
    part, fitted = part_of(unwatched(step.problem), step.fitted, places)
    few = Step(dataclasses.replace(part, checkpoint=step.problem.checkpoint), fitted)
    held = None if before is None else heldout_or_none(few.problem, few.fitted)
    best = _best_by_now(_Trials(few, linearised.scale), gains, held, progress)
    if best is None:
        return None
    # it is fitted whatever the time: without it there would be no discrepancy to state
    whole = Step(unwatched(step.problem), step.fitted, step.tested)
    found = _Trials(whole, linearised.scale).together(best.parts)
    return found if found is not None and _repairs(found, before) else None


def _best_by_now(
    trials: _Trials, gains: Mapping[Part, float], before: float | None, progress: Progress
) -> Learned | None:
    """Return the discrepancy that holds best; of those learned by then where the time is over."""
    try:
        return _best(trials, gains, before, progress)
    except BudgetSpentError:
        known = [one for learned in trials.known.values() for one in learned]
        best = min(known, key=_error, default=None)
        return best if best is not None and _repairs(best, before) else None


def _best(
    trials: _Trials, gains: Mapping[Part, float], before: float | None, progress: Progress
) -> Learned | None:
    level = trials.noise
    nothing_left = (1.0 + CRITERIA.heldout_change) * level
    much_left = CRITERIA.twice * level
    found: list[Learned] = []
    if before is not None and before > much_left:
        learned = trials.each_alone(BEYOND_FIRST_ORDER)
        for part in BEYOND_FIRST_ORDER:
            progress(_told(part), 0.0)
            found += next(learned)
            if found and _error(found[-1]) < nothing_left:
                return found[-1]
    wanted = candidates(gains)
    coarse: dict[Part, Part] = {}
    spare: list[Part] = []
    learned = trials.each_alone(wanted)
    for place, part in enumerate(wanted):
        progress(_told(part), 0.7 * place / len(wanted))
        next(learned)  # it is known from here on
        if {family for family, _ in coarse} & set(REFINED.get(part[0], ())):
            spare.append(part)  # its finer form is known already
            continue
        for one in trials.refined(part, nothing_left):
            found.append(one)
            coarse[one.parts[0]] = part
            if _error(one) < nothing_left:
                return one if _repairs(one, before) else None
    for part in LAST:
        if min(map(_error, found), default=0.0) >= much_left:
            progress(_told(part), 0.7)
            found += trials.alone(part)
    found = sorted({one.parts: one for one in found}.values(), key=_error)
    if not found or not _repairs(found[0], before):
        return None
    seconds = [f.parts[0] for f in found[1:3] if not f.parts[0][0].startswith("force")]
    # beside another one the coarse form of many numbers may hold better on other shots
    more = {part: coarse.get(part, part) for part in [*seconds, *spare, ("outline", "pair")]}
    return _with_others(trials, found[0], more, nothing_left, progress)


def _with_others(
    trials: _Trials,
    best: Learned,
    more: Mapping[Part, Part],
    nothing_left: float,
    progress: Progress,
) -> Learned:
    """Return the best discrepancy with others that improve it, each in the better of two forms."""
    for place, (part, coarse) in enumerate(more.items()):
        if part in best.parts or _error(best) < nothing_left:
            continue
        progress(f"{_told(part)} beside it", 0.7 + 0.1 * place)
        forms = list(dict.fromkeys([part, coarse]))
        tried = trials.step.problem.each(partial(trials.learned, beside=best), forms)
        both = min((t for t in tried if t is not None), key=_error, default=None)
        if both is not None and _error(both) < (1.0 - CRITERIA.heldout_change) * _error(best):
            best = both
    return best


def _told(part: Part) -> str:
    return MethodStep.VERDICT.told(f"learning a closure: {part[0]} by {part[1]}")


def _repairs(found: Learned, before: float | None) -> bool:
    return before is None or _error(found) < before


def _error(found: Learned) -> float:
    error = found.heldout_rms
    return error if error is not None and math.isfinite(error) else math.inf


def better(
    learned: Learned | None, waveform: Learned | None, before: float | None
) -> Learned | None:
    """Return which of two discrepancies repairs held-out shots better, None where neither does.

    ``waveform`` is a mean of other hits, ``before`` the present model's error on held-out shots.
    [unit of the signal]
    """
    if waveform is None or not _repairs(waveform, before):
        return learned
    return learned if learned is not None and _error(learned) <= _error(waveform) else waveform


def candidates(gains: Mapping[Part, float]) -> list[Part]:
    """Return the discrepancies worth learning, the most promising first.

    At most `MOST_LEARNED`; each family once, or with its finer form.
    """
    known = {part: gains[part] for part in LEARNABLE if part in gains}
    most = max(known.values(), default=0.0)
    chosen: dict[str, Part] = {}
    for family, scope in sorted(known, key=lambda part: -known[part]):
        gain, kind = known[family, scope], "contact" if family in FORCED else family
        if gain < CRITERIA.little * most:
            break
        old = chosen.get(kind)
        if old is None:
            take = len(chosen) < MOST_LEARNED
        else:
            lead = (1.0 + CRITERIA.nothing) * gain
            take = scope == "rig" and known[old] < lead
        if take:
            chosen[kind] = (family, scope)
    if gains.get(("speed", "shot"), 0.0) > CRITERIA.nearly_all * most:
        # every shot has its own speed anyway: what a release does leaves little in the trace
        chosen = dict(list(chosen.items())[:1])
    return [(ALSO.get(kind, family), scope) for kind, (family, scope) in chosen.items()]


@dataclass
class _Trials:
    """Discrepancies as they are learned, none of them alone more than once."""

    step: Step
    scale: Scale
    known: dict[Part, list[Learned]] = field(default_factory=dict)

    @property
    def noise(self) -> float:
        """Return the rms noise of all shots. [unit of the signal]"""
        return math.sqrt(float(np.mean([s.noise.rms**2 for s in self.step.problem.shots])))

    def alone(self, part: Part) -> list[Learned]:
        """Return a discrepancy learned on the present model; none where it makes nothing better."""
        return next(self.each_alone([part]))

    def each_alone(self, parts: Sequence[Part]) -> Iterator[list[Learned]]:
        """Yield what `alone` returns of each."""
        new = [part for part in parts if part not in self.known]
        learned = self.step.problem.each(self.learned, new)
        for part in parts:
            if part not in self.known:
                one = next(learned)
                self.known[part] = [] if one is None else [one]
            yield self.known[part]

    def refined(self, part: Part, nothing_left: float) -> list[Learned]:
        """Return a discrepancy, or a finer form where that holds better; none where none does."""
        family, scope = part
        best = self.alone(part)
        for finer in REFINED.get(family, ()):
            if not best or _error(best[0]) < nothing_left:
                break
            fine = self.alone((finer, scope if finer in SAME_GROUPS else "rig"))
            if fine and _error(fine[0]) < _error(best[0]):
                best = fine
        return best

    def learned(self, part: Part, beside: Learned | None = None) -> Learned | None:
        """Return a discrepancy, learned together with one that is known already."""
        family, scope = part
        if family in FORCED:
            return self.together([(FORCE + form, scope) for form in FORCES])
        if beside is not None and beside.parts[0][0].startswith(FORCE):
            return self.beside_force(beside, [part])
        return self.together([*(beside.parts if beside else ()), part])

    def together(self, parts: Sequence[Part]) -> Learned | None:
        """Return the discrepancy of these parts; None where it makes nothing better."""
        step = self.step
        forms = [(family.removeprefix(FORCE), s) for family, s in parts if family.startswith(FORCE)]
        rest = [part for part in parts if not part[0].startswith(FORCE)]
        with contextlib.suppress(np.linalg.LinAlgError):
            if not forms:
                return learn(step.problem, step.fitted, rest, self.scale)
            first = learn_force(
                step.problem,
                step.fitted,
                step.residual,
                forms=[form for form, _ in forms],
                scope=forms[0][1],
            )
            return self.beside_force(first, rest) if first is not None and rest else first
        return None

    def beside_force(self, force: Learned, parts: Sequence[Part]) -> Learned | None:
        """Return a free force with more beside it; None where that makes nothing better."""
        with contextlib.suppress(np.linalg.LinAlgError):
            more = learn(force.problem, force.fitted, parts, self.scale)
            return None if more is None else on_top(force, more)
        return None
