"""Which discrepancies are worth learning, and which repairs held-out shots best."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.fitted import Learned, learn, learn_force, on_top
from analysis.diagnosis.linearised import Explained, Linearised
from analysis.diagnosis.method_steps import MethodStep, Progress
from analysis.diagnosis.slots import Part, worth
from analysis.diagnosis.stepwise.forward import Step
from analysis.diagnosis.time_budget import BudgetSpentError

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
OWNED = ("damped", "jump")
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
    answers: dict[Part, Explained],
    before: float | None,
    progress: Progress,
) -> Learned | None:
    """Return the discrepancy that repairs held-out shots best.

    Parameters
    ----------
    step : Step
        The present model.
    linearised : Linearised
        With the answers' families; it knows the tuned frequencies.
    answers : dict
        What each family explains, to first order.
    before : float or None
        Error of the present model on held-out shots. [unit of the signal]
    progress : callable
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    Learned or None
        One discrepancy, or a few together where they are needed; None where none repairs held-out
        shots, as where speeds only contradict their heights. Where the time is over the best of
        those learned by then.
    """
    trials = _Trials(step, linearised)
    try:
        return _best(trials, answers, before, progress)
    except BudgetSpentError:
        known = [one for learned in trials.known.values() for one in learned]
        best = min(known, key=_error, default=None)
        return best if best is not None and _repairs(best, before) else None


def _best(
    trials: _Trials, answers: dict[Part, Explained], before: float | None, progress: Progress
) -> Learned | None:
    """Return the discrepancy that repairs held-out shots best, of as many as it takes."""
    level = _noise(trials.linearised)
    much = before is not None and before > CRITERIA.discrepancy.much_left_ratio * level
    found = _beyond_first_order(trials, level, progress) if much else []
    if found and _error(found[-1]) < CRITERIA.discrepancy.nothing_left_ratio * level:
        return found[-1]
    wanted = candidates(answers)
    coarse: dict[Part, Part] = {}
    spare: list[Part] = []
    for place, part in enumerate(wanted):
        progress(_discrepancy_told(part), 0.7 * place / len(wanted))
        if {family for family, _ in coarse} & set(REFINED.get(part[0], ())):
            spare.append(part)  # its finer form is known already
            continue
        for one in _refined(trials, part, level):
            found.append(one)
            coarse[one.parts[0]] = part
            if _error(one) < CRITERIA.discrepancy.nothing_left_ratio * level:
                return one if _repairs(one, before) else None
    for part in LAST:
        if min(map(_error, found), default=0.0) >= CRITERIA.discrepancy.much_left_ratio * level:
            progress(_discrepancy_told(part), 0.7)
            found += trials.alone(part)
    found = list({one.parts: one for one in found}.values())
    found.sort(key=_error)
    if not found or not _repairs(found[0], before):
        return None
    best = found[0]
    seconds = [f.parts[0] for f in found[1:3] if not f.parts[0][0].startswith("force")]
    for place, part in enumerate(dict.fromkeys([*seconds, *spare, ("outline", "pair")])):
        if part in best.parts or _error(best) < CRITERIA.discrepancy.nothing_left_ratio * level:
            continue
        progress(f"{_discrepancy_told(part)} beside it", 0.7 + 0.1 * place)
        # beside another one the coarse form of many numbers may hold better on other shots
        forms = dict.fromkeys([part, coarse.get(part, part)])
        tried = [trials.beside(best, form) for form in forms]
        both = min((t for t in tried if t is not None), key=_error, default=None)
        if both is not None and _error(both) < CRITERIA.discrepancy.further_ratio * _error(best):
            best = both
    return best


def _discrepancy_told(part: Part) -> str:
    return MethodStep.VERDICT.told(f"learning a closure: {part[0]} by {part[1]}")


def _beyond_first_order(trials: _Trials, level: float, progress: Progress) -> list[Learned]:
    """Return the discrepancies beyond first order up to the first that leaves nothing."""
    found: list[Learned] = []
    for part in BEYOND_FIRST_ORDER:
        progress(_discrepancy_told(part), 0.0)
        for one in trials.alone(part):
            found.append(one)
            if _error(one) < CRITERIA.discrepancy.nothing_left_ratio * level:
                return found
    return found


def _repairs(found: Learned, before: float | None) -> bool:
    return before is None or _error(found) < before


def better(
    learned: Learned | None, waveform: Learned | None, before: float | None
) -> Learned | None:
    """Return which of two discrepancies repairs held-out shots better, None where neither does.

    Parameters
    ----------
    learned : Learned or None
        From `best_closure`.
    waveform : Learned or None
        The mean waveform of other hits.
    before : float or None
        Error of the present model on held-out shots. [unit of the signal]

    Returns
    -------
    Learned or None
        One of them.
    """
    if waveform is None or not _repairs(waveform, before):
        return learned
    return learned if learned is not None and _error(learned) <= _error(waveform) else waveform


def candidates(answers: dict[Part, Explained]) -> list[Part]:
    """Return the discrepancies worth learning, the most promising first.

    Parameters
    ----------
    answers : dict
        What each family explains, to first order.

    Returns
    -------
    list of tuple
        (family, scope), at most `MOST_LEARNED`; each family once, or with its finer form.
    """
    gains = {part: worth(answers[part]) for part in LEARNABLE if part in answers}
    most = max(gains.values(), default=0.0)
    ranked = sorted(gains, key=lambda p: -gains[p])
    chosen: dict[str, Part] = {}
    for family, scope in ranked:
        kind = "contact" if family in FORCED else family
        if gains[family, scope] < CRITERIA.discrepancy.learned_share * most:
            break
        old = chosen.get(kind)
        room = old is None and len(chosen) < MOST_LEARNED
        if room or (
            old
            and scope == "rig"
            and gains[old] < CRITERIA.discrepancy.owned_lead_ratio * gains[family, scope]
        ):
            chosen[kind] = (family, scope)
    speed = worth(answers["speed", "shot"]) if ("speed", "shot") in answers else 0.0
    if speed > CRITERIA.discrepancy.speeds_alone_share * most:
        # every shot has its own speed anyway: what a release does leaves little in the trace
        chosen = dict(list(chosen.items())[:1])
    return [(ALSO.get(kind, family), scope) for kind, (family, scope) in chosen.items()]


def _noise(linearised: Linearised) -> float:
    """Return the rms noise of all shots. [unit of the signal]"""
    return math.sqrt(float(np.mean([s.item.noise.rms**2 for s in linearised.shots])))


def _error(found: Learned) -> float:
    error = found.heldout_rms
    return error if error is not None and math.isfinite(error) else math.inf


@dataclass
class _Trials:
    """Discrepancies as they are learned, none of them alone more than once."""

    step: Step
    linearised: Linearised
    known: dict[Part, list[Learned]] = field(default_factory=dict)

    def alone(self, part: Part) -> list[Learned]:
        """Return a discrepancy learned on the present model; none where it makes nothing better."""
        if part not in self.known:
            one = self._tried(None, part)
            self.known[part] = [] if one is None else [one]
        return self.known[part]

    def beside(self, best: Learned, part: Part) -> Learned | None:
        """Return a discrepancy learned together with one that is known already."""
        return self._tried(best, part)

    def _tried(self, beside: Learned | None, part: Part) -> Learned | None:
        step, scale = self.step, self.linearised.scale
        family, scope = part
        try:
            if family in FORCED:
                return learn_force(
                    step.problem, step.fitted, step.linearised, forms=FORCES, scope=scope
                )
            if beside is None:
                return learn(step.problem, step.fitted, [part], scale)
            if beside.parts[0][0].startswith("force"):
                more = learn(beside.problem, beside.fitted, [part], scale)
                return None if more is None else on_top(beside, more)
            return learn(step.problem, step.fitted, [*beside.parts, part], scale)
        except np.linalg.LinAlgError:
            return None


def _refined(trials: _Trials, part: Part, level: float) -> list[Learned]:
    """Return a discrepancy, or a finer form where that holds better; none where none does."""
    family, scope = part
    best = trials.alone(part)
    for finer in REFINED.get(family, ()):
        if not best or _error(best[0]) < CRITERIA.discrepancy.nothing_left_ratio * level:
            break
        fine = trials.alone((finer, scope if finer in OWNED else "rig"))
        if fine and _error(fine[0]) < _error(best[0]):
            best = fine
    return best
