"""Where a discrepancy lives, and what repairs it on other shots."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from analysis.discovery.closure import Learned
from analysis.discovery.closure_choice import best_closure, better
from analysis.discovery.criteria import CRITERIA
from analysis.discovery.evidence import Evidence, Explained, gather
from analysis.discovery.mean_waveform import MeanWaveform, mean_waveform
from analysis.discovery.method_steps import MethodStep, Progress
from analysis.discovery.omnibus import SLOTS
from analysis.discovery.quality import heldout_or_none
from analysis.discovery.slot_physics import peculiar_odds
from analysis.discovery.slot_table import SLOT_NAMES
from analysis.discovery.slots import (
    FAMILIES,
    Part,
    ask_bank,
    features,
    probabilities,
    worth,
)
from analysis.discovery.trail import Step
from analysis.discovery.waveform_closure import waveform_closure

FORMULA_TERMS = 2
MOST_MODES = 2
"""Modes of variation that a waveform may have. A choice: of three hits no more can be told."""


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
        Fall of the whitened squares that the slot's best closure brings, its numbers paid for; of
        held-out shots where it was learned.
    closure : Explained
        The family with shared coefficients that explains most, to first order.
    learned : Learned or None
        The closure that repairs held-out shots best.
    by_columns : Learned or None
        The same without the mean waveform, which says neither where a discrepancy lives nor what
        makes it.
    mean : MeanWaveform or None
        What the mean of other hits predicts; None where nobody asked.
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
    by_columns: Learned | None = None
    mean: MeanWaveform | None = None

    @property
    def hardly_anywhere(self) -> bool:
        """Whether even the best slot's closure explains little of the structure."""
        return self.gains[self.slot] < CRITERIA.slot.explained_share * self.structure

    @property
    def also(self) -> list[str]:
        """Return the other slots that the data cannot rule out."""
        return [
            s
            for s, p in sorted(self.probabilities.items())
            if s != self.slot and p >= CRITERIA.slot.named_beside_probability
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
    progress(MethodStep.VERDICT.told("where does it live?"), 0.0)
    evidence = gather(step.problem, step.fitted, wanted=FAMILIES)
    answers = ask_bank(evidence)
    odds = probabilities(features(answers, step.problem.shots))
    closure = _explains_most(evidence, answers)
    # where the time is over from here on: no closure, or the best of those learned by then
    before = heldout_or_none(step.problem, step.fitted)
    by_columns = best_closure(step, evidence, answers, before, progress)
    repaired = None if by_columns is None else _heldout_gain(step, by_columns, before)
    gains = _gains(answers, by_columns, repaired)
    if by_columns is not None and repaired is not None:
        only = _peculiar(by_columns, repaired, max(map(worth, answers.values())))
        odds = only or odds
        gains |= {
            s: max(gains[s], repaired)
            for s, p in only.items()
            if p >= CRITERIA.slot.named_beside_probability
        }
    slot = max(odds, key=lambda s: odds[s])
    samples = sum(s.white.size for s in step.evidence.shots)
    structure = max(step.evidence.chi2 - samples, *gains.values(), 1.0)
    progress(MethodStep.VERDICT.told("is it better than a mean of the other hits?"), 0.99)
    mean = mean_waveform(step.problem, MOST_MODES)
    learned = better(by_columns, waveform_closure(step, mean), before)
    return Located(
        slot,
        odds,
        gains,
        closure,
        learned,
        structure,
        formula(evidence, closure),
        by_columns,
        mean,
    )


def _explains_most(evidence: Evidence, answers: dict[Part, Explained]) -> Explained:
    """Return the family with shared coefficients that explains most, the rig's where it does."""
    shared = [e for e in answers.values() if e.scope != "shot" and e.family != "speed"]
    closure = max(shared, key=worth)
    common = answers.get((closure.family, "rig"), closure)
    if CRITERIA.closure.owned_lead_ratio * worth(common) >= worth(closure):
        closure = common
    return evidence.explain(closure.family, closure.scope)


def _peculiar(learned: Learned, repaired: float, most: float) -> dict[str, float]:
    """Return how likely each slot is where only a peculiar closure explains much, else nothing."""
    odds = peculiar_odds(learned.parts[0][0])
    if odds is None or repaired <= CRITERIA.slot.peculiar_lead_ratio * most:
        return {}
    return dict(zip(SLOT_NAMES, map(float, odds), strict=True))


def _gains(
    answers: dict[Part, Explained], learned: Learned | None, repaired: float | None
) -> dict[str, float]:
    """Return each slot's best gain, that of the learned closure as held-out shots have it."""
    found = {part: worth(answer) for part, answer in answers.items()}
    if learned is not None and learned.parts[0] in found and len(learned.parts) == 1:
        found[learned.parts[0]] = found[learned.parts[0]] if repaired is None else repaired
    return {
        slot: max(0.0, *(found[part] for part in families if part in found))
        for slot, families in SLOTS.items()
    }


def _heldout_gain(step: Step, learned: Learned, before: float | None) -> float | None:
    """Return the fall of the squares of held-out shots in units of the noise, where known."""
    if not before or not learned.heldout_rms:
        return None
    count = sum(s.residual.size for s in step.evidence.shots)
    level = float(np.mean([s.item.noise.rms for s in step.evidence.shots]))
    return count * (before**2 - learned.heldout_rms**2) / level**2


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
        if tried[best].heldout_gain > CRITERIA.slot.formula_share * closure.heldout_gain:
            return list(tried[best].coefficients.items())
    return []


def _some(
    evidence: Evidence, closure: Explained, at: list[int], labels: list[str], which: list[int]
) -> Explained:
    """Return what some of a family's columns explain."""
    part = ([at[j] for j in which], [labels[j] for j in which])
    trial = dataclasses.replace(evidence, families={**evidence.families, "trial": part})
    return trial.explain("trial", closure.scope)
