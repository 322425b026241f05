"""Where a discrepancy lives, and what repairs it on other shots."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.choice import best_discrepancy, better
from analysis.diagnosis.discrepancy.fitted import Learned
from analysis.diagnosis.discrepancy.mean_waveform import MeanWaveform, mean_waveform
from analysis.diagnosis.discrepancy.waveform import waveform_discrepancy
from analysis.diagnosis.held_out import heldout_or_none
from analysis.diagnosis.linearised import Explained, Linearised, linearise
from analysis.diagnosis.method_steps import MethodStep, Progress
from analysis.diagnosis.slots import (
    FAMILIES,
    Part,
    explained_by_family,
    gains_by_slot,
    probabilities,
    worth,
)
from analysis.diagnosis.stepwise.forward import Step

FORMULA_TERMS = 2
"""A formula of more columns nobody reads as one."""
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
        Fall of the whitened squares by the slot's best discrepancy, its numbers paid for; of
        held-out shots where it was learned.
    discrepancy : Explained
        The family with shared coefficients that explains most, to first order.
    learned : Learned or None
        The discrepancy that repairs held-out shots best.
    by_columns : Learned or None
        The same without the mean waveform, which says neither where a discrepancy lives nor what
        makes it.
    mean : MeanWaveform or None
        What the mean of other hits predicts; None where nobody asked.
    structure : float
        Whitened squares of the residual beyond what noise alone would leave.
    formula : list of tuple
        Label, group's scope, coefficient of the few columns that hold on held-out shots, where so
        few do.
    """

    slot: str
    probabilities: dict[str, float]
    gains: dict[str, float]
    discrepancy: Explained
    learned: Learned | None
    structure: float
    formula: list[tuple[str, float]] = field(default_factory=list)
    by_columns: Learned | None = None
    mean: MeanWaveform | None = None

    @property
    def hardly_anywhere(self) -> bool:
        """Whether even the best slot's discrepancy explains little of the structure."""
        return self.gains[self.slot] < CRITERIA.slot.explained_share * self.structure

    @property
    def also(self) -> list[str]:
        """Return the other slots that the data cannot rule out."""
        return [
            s
            for s, p in sorted(self.probabilities.items())
            if s != self.slot
            and p >= CRITERIA.slot.named_beside_share * self.probabilities[self.slot]
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
        With the learned discrepancy.
    """
    progress(MethodStep.VERDICT.told("where does it live?"), 0.0)
    linearised = linearise(step.problem, step.fitted, wanted=FAMILIES)
    answers = explained_by_family(linearised)
    discrepancy = _explains_most(linearised, answers)
    # where the time is over from here on: no discrepancy, or the best of those learned by then
    before = heldout_or_none(step.problem, step.fitted)
    by_columns = best_discrepancy(step, linearised, answers, before, progress)
    explained = _explained(step, answers, by_columns, before)
    gains = gains_by_slot(explained)
    samples = sum(s.white.size for s in step.linearised.shots)
    structure = max(step.linearised.chi2 - samples, *gains.values(), 1.0)
    pairs = len({s.pair for s in step.problem.shots})
    odds = probabilities(explained, structure, pairs)
    slot = max(odds, key=lambda s: odds[s])
    progress(MethodStep.VERDICT.told("is it better than a mean of the other hits?"), 0.99)
    mean = mean_waveform(step.problem, MOST_MODES)
    learned = better(by_columns, waveform_discrepancy(step, mean), before)
    return Located(
        slot,
        odds,
        gains,
        discrepancy,
        learned,
        structure,
        formula(linearised, discrepancy),
        by_columns,
        mean,
    )


def _explains_most(linearised: Linearised, answers: dict[Part, Explained]) -> Explained:
    """Return the family with shared coefficients that explains most, the rig's where it does."""
    shared = [e for e in answers.values() if e.scope != "shot" and e.family != "speed"]
    discrepancy = max(shared, key=worth)
    common = answers.get((discrepancy.family, "rig"), discrepancy)
    if CRITERIA.discrepancy.owned_lead_ratio * worth(common) >= worth(discrepancy):
        discrepancy = common
    return linearised.explain(discrepancy.family, discrepancy.scope)


def _explained(
    step: Step, answers: dict[Part, Explained], learned: Learned | None, before: float | None
) -> dict[Part, float]:
    """Return what each family explains, the learned one's as held-out shots have it."""
    found = {part: worth(answer) for part, answer in answers.items()}
    repaired = None if learned is None else _heldout_gain(step, learned, before)
    if learned is not None and repaired is not None:
        part = learned.parts[0]
        foretold = part in found
        if not foretold or len(learned.parts) == 1:
            found[part] = repaired
    return found


def _heldout_gain(step: Step, learned: Learned, before: float | None) -> float | None:
    """Return the fall of the squares of held-out shots in units of the noise, where known."""
    if not before or not learned.heldout_rms:
        return None
    count = sum(s.residual.size for s in step.linearised.shots)
    level = float(np.mean([s.item.noise.rms for s in step.linearised.shots]))
    return count * (before**2 - learned.heldout_rms**2) / level**2


def formula(linearised: Linearised, discrepancy: Explained) -> list[tuple[str, float]]:
    """Return the few columns of a discrepancy that do nearly all of its work on held-out shots.

    Parameters
    ----------
    linearised : Linearised
        It was learned from.
    discrepancy : Explained
        A family with its scope.

    Returns
    -------
    list of tuple
        Label with group, and coefficient; empty where more than `FORMULA_TERMS` are needed.
    """
    if discrepancy.scope == "shot" or discrepancy.heldout_gain <= 0:
        return []
    at, labels = linearised.families[discrepancy.family]
    chosen: list[int] = []
    for _ in range(FORMULA_TERMS):
        tried = {}
        for j in range(len(at)):
            if j not in chosen:
                tried[j] = _some(linearised, discrepancy, at, labels, [*chosen, j])
        best = max(tried, key=lambda j: tried[j].heldout_gain, default=None)
        if best is None:
            return []
        chosen.append(best)
        if tried[best].heldout_gain > CRITERIA.slot.formula_share * discrepancy.heldout_gain:
            return list(tried[best].coefficients.items())
    return []


def _some(
    linearised: Linearised,
    discrepancy: Explained,
    at: list[int],
    labels: list[str],
    which: list[int],
) -> Explained:
    """Return what some of a family's columns explain."""
    part = ([at[j] for j in which], [labels[j] for j in which])
    trial = dataclasses.replace(linearised, families={**linearised.families, "trial": part})
    return trial.explain("trial", discrepancy.scope)
