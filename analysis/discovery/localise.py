"""Where a discrepancy lives: what the most flexible closure of each slot repairs on other shots."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field

import numpy as np

from analysis.discovery.closure import Learned, learn, learn_force
from analysis.discovery.evidence import Evidence, Explained
from analysis.discovery.omnibus import SLOTS, Omnibus, ask
from analysis.discovery.trail import Progress, Step
from analysis.fit.campaign_fit import heldout_rms

SHARP = 0.1
"""Share of the best slot's gain by which another must fall behind to be e times less likely."""
LEAST_SPREAD = 20.0
"""Whitened squares by which slots must differ at least to be told apart."""
EXPLAINS_LITTLE = 0.3
CANNOT_TELL = 0.25
"""A slot at least this likely is named beside the likeliest."""
WORTH_LEARNING = 0.2
"""Share of the best first-order gain from which a closure is learned for real."""
MOST_LEARNED = 3
OWN_WEIGHT = 0.3
MUCH_BETTER = 1.5
FORCES = ("elastic", "rate")
FORMULA_TERMS = 2
FORMULA_SHARE = 0.9


@dataclass(frozen=True)
class Located:
    """Where it lives and what repairs it.

    Attributes
    ----------
    slot : str
        The likeliest.
    probabilities : dict
        By slot.
    gains : dict
        Fall of the whitened squares of held-out shots that the slot's best closure brings.
    closure : Explained
        The family that explains most on held-out shots, to first order.
    learned : Learned or None
        The closure that repairs held-out shots best.
    structure : float
        Whitened squares of the residual beyond what noise alone would leave.
    formula : list of tuple
        Label, owner's scope, coefficient of the few columns that hold on held-out shots, where so
        few do.
    """

    slot: str
    probabilities: dict[str, float]
    gains: dict[str, float]
    closure: Explained
    learned: Learned | None
    structure: float
    formula: list[tuple[str, float]] = field(default_factory=list)

    @property
    def hardly_anywhere(self) -> bool:
        """Whether even the best slot's closure explains little of the structure."""
        return self.gains[self.slot] < EXPLAINS_LITTLE * self.structure

    @property
    def also(self) -> list[str]:
        """Return the other slots that the data cannot rule out."""
        return [
            s for s, p in sorted(self.probabilities.items()) if s != self.slot and p >= CANNOT_TELL
        ]


def locate(step: Step, progress: Progress) -> Located:
    """Return where the structure in a model's residual lives.

    Parameters
    ----------
    step : Step
        A turn whose residual is structured.
    progress : callable
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    Located
        With the learned closure.
    """
    asked = ask(step.evidence, heldout=True)
    closure = max(asked.answers.values(), key=lambda e: e.heldout_gain)
    learned = _learn_best(step, asked, closure.heldout_gain, progress)
    gains = _gains(step, asked, learned)
    odds = _probabilities(gains)
    slot = max(odds, key=lambda s: odds[s])
    best = min(
        (found for found in learned.values() if found.heldout_rms is not None),
        key=lambda found: found.heldout_rms or math.inf,
        default=None,
    )
    samples = sum(s.white.size for s in step.evidence.shots)
    structure = max(step.evidence.chi2 - samples, *gains.values(), 1.0)
    return Located(slot, odds, gains, closure, best, structure, formula(step.evidence, closure))


def _learn_best(
    step: Step, asked: Omnibus, lead: float, progress: Progress
) -> dict[tuple[str, str], Learned]:
    """Return the closures worth it, learned: the best family of each slot, and what repeats."""
    wanted: list[tuple[str, str]] = []
    for families in SLOTS.values():
        known = [f for f in families if f in asked.answers and f[0] != "speed" and f[1] != "shot"]
        best = max(known, key=lambda f: asked.answers[f].heldout_gain, default=None)
        if best and asked.answers[best].heldout_gain > WORTH_LEARNING * lead:
            wanted.append(best)
    wanted = sorted(set(wanted), key=lambda f: -asked.answers[f].heldout_gain)[:MOST_LEARNED]
    wanted.append(("template", "rig"))
    found = {}
    for place, part in enumerate(wanted):
        progress(f"learning a closure: {part[0]} by {part[1]}", place / (len(wanted) + 1))
        one = _learned(step, part)
        if one is not None and one.heldout_rms is not None and math.isfinite(one.heldout_rms):
            found[part] = one
    return found


def _learned(step: Step, part: tuple[str, str]) -> Learned | None:
    family, scope = part
    try:
        one = learn(step.problem, step.fitted, [part])
        if family in ("contact", "loss"):
            force = learn_force(
                step.problem, step.fitted, step.evidence, forms=FORCES, scope=scope
            )
            if force is not None and _better(force, one):
                one = force
    except np.linalg.LinAlgError:
        return None
    return one


def _better(one: Learned, other: Learned | None) -> bool:
    if one.heldout_rms is None or not math.isfinite(one.heldout_rms):
        return False
    return other is None or one.heldout_rms < (other.heldout_rms or math.inf)


def _gains(
    step: Step, asked: Omnibus, learned: dict[tuple[str, str], Learned]
) -> dict[str, float]:
    """Return each slot's best gain on held-out shots, learned for real where it was."""
    before = heldout_rms(step.problem, step.fitted)
    count = sum(s.residual.size for s in step.evidence.shots)
    level = float(np.mean([s.item.noise.rms for s in step.evidence.shots]))
    samples = sum(s.white.size for s in step.evidence.shots)
    most = max(step.evidence.chi2 - samples, 0.0)
    found: dict[tuple[str, str], float] = {}
    for part, answer in asked.answers.items():
        gain = answer.heldout_gain
        if part[1] == "shot":
            gain *= OWN_WEIGHT  # numbers of each shot are held to no other shot
        one = learned.get(part)
        if one is not None and before is not None and one.heldout_rms is not None:
            gain = count * (before**2 - one.heldout_rms**2) / level**2
        found[part] = 0.0 if _alone(step, part[1]) else min(gain, most)
    chain = found.get(("response", "rig"), 0.0)
    if found.get(("response", "surface"), 0.0) < MUCH_BETTER * chain:
        # one chain for all surfaces is the simpler half of it
        found["response", "surface"] = max(found["response", "surface"] - chain, 0.0)
    return {
        slot: max(0.0, *(found[part] for part in families if part in found))
        for slot, families in SLOTS.items()
    }


def _alone(step: Step, scope: str) -> bool:
    """Tell whether an owner among several is meant where there is only one."""
    if scope not in ("surface", "sphere", "pair"):
        return False
    owners = {owner for own in step.evidence.owners(scope) for owner, _ in own}
    return len(owners) < 2


def _probabilities(gains: dict[str, float]) -> dict[str, float]:
    """Return how likely each slot is, by how far its closure falls behind the best."""
    lead = max(gains.values())
    spread = max(SHARP * lead, LEAST_SPREAD)
    weights = {s: math.exp(-(lead - g) / spread) for s, g in gains.items()}
    total = sum(weights.values())
    return {s: w / total for s, w in weights.items()}


def formula(evidence: Evidence, closure: Explained) -> list[tuple[str, float]]:
    """Return the few columns of a closure that do nearly all of its work on held-out shots.

    Parameters
    ----------
    evidence : Evidence
        It was learned from.
    closure : Explained
        A family with its scope.

    Returns
    -------
    list of tuple
        Label with owner, and coefficient; empty where more than `FORMULA_TERMS` are needed.
    """
    if closure.scope == "shot" or closure.heldout_gain <= 0:
        return []
    at, labels = evidence.families[closure.family]
    chosen: list[int] = []
    for _ in range(FORMULA_TERMS):
        tried = {}
        for j in range(len(at)):
            if j not in chosen:
                tried[j] = _some(evidence, closure, at, labels, [*chosen, j])
        best = max(tried, key=lambda j: tried[j].heldout_gain, default=None)
        if best is None:
            return []
        chosen.append(best)
        if tried[best].heldout_gain > FORMULA_SHARE * closure.heldout_gain:
            return list(tried[best].coefficients.items())
    return []


def _some(
    evidence: Evidence, closure: Explained, at: list[int], labels: list[str], which: list[int]
) -> Explained:
    """Return what some of a family's columns explain."""
    part = ([at[j] for j in which], [labels[j] for j in which])
    trial = dataclasses.replace(evidence, families={**evidence.families, "trial": part})
    return trial.explain("trial", closure.scope)
