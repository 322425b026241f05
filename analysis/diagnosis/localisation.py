r"""The slot of a discrepancy, and the discrepancy that repairs held-out shots.

A family k of columns explains :math:`g_k` of the T structured whitened squares, its coefficients
paid for, and leaves the share

.. math:: l_k = \frac{(1 + e) T - g_k + c}{(1 + e) T + c} .

What is left is a misfit whose size nobody knows. What a family does not describe of one sphere it
does not describe under each coupon: a pair's misfit is a sphere's and a coupon's, and of S spheres
on C coupons n = S + C - 1 pieces are independent. Integrated over the size the likelihood is

.. math:: L_k \propto l_k^{-n/2}, \qquad p_s \propto \max_k M_{ks} L_k ,

where M is how usual a change of kind k is for the slot s, by the family of its columns and by the
shots that share its coefficients: shares written by hand, none where the slot cannot do it. What
two slots do alike (a memoryless curve: the crystal or the converter) stands under both, and where
no family explains much all slots are as likely. A part `UNLISTED` of the probability is every
slot's alike: the change may be one that no family describes. Nothing here was trained.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.discrepancy.choice import best_discrepancy, better
from analysis.diagnosis.discrepancy.fit import Learned, Part
from analysis.diagnosis.discrepancy.mean_waveform import (
    MeanWaveform,
    mean_waveform,
    waveform_discrepancy,
)
from analysis.diagnosis.held_out import heldout_or_none
from analysis.diagnosis.linearised import Explained, Linearised, linearise
from analysis.diagnosis.progress import MethodStep, Progress, unwatched
from analysis.diagnosis.selection import Step
from analysis.effects.effect import SLOTS

FORMULA_TERMS = 2
"""A formula of more columns nobody reads as one."""
MOST_MODES = 2
"""Modes of variation that a waveform may have. A choice: of three hits no more can be told."""
LEAST = 10.0
"""c, whitened squares that chance brings. Derived: chi-square with one degree of freedom exceeds 10
with 0.16 %, so that of some 80 families one does in every eighth campaign."""
FIRST_ORDER_ERROR = 0.02
"""e, share of what they describe that a first order and columns in steps leave. Chosen by trial:
0.02 and 0.1 gave the same slots in 52 campaigns."""

UNLISTED = 0.05
"""Probability of a change that no family describes. Measured: in 10 of 200 visible campaigns with
seeds from 47100000 no family of a slot explained 0.3 of the squares. The likeliest slot does not
depend on it."""

SHARES: dict[str, tuple[float, float, float, float, float]] = {
    #            release contact mounting sensor electronics
    "speed":     (1.0,    0.0,    0.0,     0.0,   0.0),  # of the impact, against its height
    "stiffness": (0.0,    1.0,    0.0,     0.0,   0.0),
    "contact":   (0.0,    1.0,    0.0,     0.0,   0.0),  # a force over indentation and rate
    "loss":      (0.0,    1.0,    0.0,     0.0,   0.0),
    "pitch":     (0.0,    0.0,    0.9,     0.9,   0.0),  # what rides on the crystal, or itself
    "cell":      (0.0,    0.0,    0.8,     0.8,   0.0),  # pitch and gain together
    "mode":      (0.0,    0.0,    0.9,     0.9,   0.0),
    "ringing":   (0.0,    0.0,    0.8,     0.9,   0.0),
    "slow":      (0.0,    0.0,    0.8,     0.8,   0.0),
    "seat":      (0.0,    0.0,    1.0,     0.8,   0.0),  # a spring or a damper that is not linear
    "gain":      (0.0,    0.0,    0.0,     1.0,   1.0),
    "creep":     (0.0,    0.0,    0.0,     0.9,   0.9),
    "curve":     (0.0,    0.0,    0.0,     1.0,   1.0),
    "fine":      (0.0,    0.0,    0.0,     0.7,   0.9),  # with jumps, as a converter's steps
    "zero":      (0.0,    0.0,    0.0,     0.9,   0.9),
    "bend":      (0.0,    0.0,    0.0,     1.0,   0.8),
    "path":      (0.0,    0.0,    0.0,     1.0,   0.8),
    "top":       (0.0,    0.0,    0.0,     0.8,   1.0),
    "quick":     (0.0,    0.0,    0.0,     0.5,   0.9),  # within a few microseconds
    "memory":    (0.0,    0.0,    0.0,     0.7,   0.9),
    "response":  (0.0,    0.0,    0.8,     0.8,   0.8),  # any linear chain
    "droop":     (0.0,    0.0,    0.0,     0.6,   1.0),
    "dynamic":   (0.0,    0.0,    0.0,     0.6,   1.0),
    "clock":     (0.0,    0.0,    0.0,     0.0,   0.9),
    "wander":    (0.0,    0.0,    0.0,     0.0,   0.8),  # fifteen numbers a shot follow much else
    "swing":     (0.0,    0.0,    0.0,     0.0,   1.0),  # there before the trigger
    # only learned, where no first order foretells them:
    "slew":      (0.0,    0.0,    0.0,     0.0,   1.0),
    "jump":      (0.0,    0.0,    0.0,     0.0,   1.0),
    "ripple":    (0.0,    0.0,    0.0,     0.0,   1.0),
    "alternate": (0.0,    0.0,    0.0,     0.0,   1.0),
    "warmth":    (0.0,    0.0,    0.0,     0.8,   1.0),
    "blow":      (0.7,    0.0,    1.0,     0.0,   0.0),  # something lands, or the sphere does
}  # fmt: skip
"""The family's factor of M, in the order of `SLOTS`; ``locked`` fits anything: it is no slot's."""

SHARES_BY_SCOPE: dict[str, tuple[float, float, float, float, float]] = {
    # release contact mounting sensor electronics
    "rig":     (1.0, 1.0, 0.8, 1.0, 1.0),
    "shot":    (1.0, 1.0, 0.8, 1.0, 1.0),
    "surface": (0.5, 1.0, 1.0, 0.5, 0.3),
    "sphere":  (1.0, 1.0, 0.5, 0.5, 0.3),
    "pair":    (0.5, 1.0, 0.5, 0.5, 0.3),
}  # fmt: skip
"""The scope's factor of M; 1 for the others. A mount differs from coupon to coupon. The crystal and
what follows it do not know what is hit: they differ with the materials only by way of the signal's
size and length."""

FAMILIES = (
    "response", "static", "dynamic", "locked", "contact", "loss", "cell", "speed", "gain", "pitch",
    "stiffness", "creep", "slow", "curve", "fine", "path", "droop", "seat", "wander", "swing",
    "clock", "mode",
)  # fmt: skip
"""What has to be gathered for `BANK`."""

BANK: tuple[Part, ...] = (
    *((family, "shot") for family in (
        "speed", "stiffness", "gain", "pitch", "cell", "slow", "ringing", "wander", "swing",
        "clock", "mode", "locked",
    )),
    *((family, "rig") for family in (
        "response", "memory", "ringing", "creep", "slow", "curve", "zero", "top", "bend", "path",
        "droop", "dynamic", "contact", "loss", "locked", "mode",
    )),
    *((family, "surface") for family in (
        "gain", "pitch", "response", "ringing", "creep", "slow", "curve", "path", "contact",
        "loss", "locked", "cell", "mode",
    )),
    *((family, "sphere") for family in (
        "gain", "pitch", "response", "slow", "curve", "path", "contact", "loss", "locked",
    )),
    *((family, "pair") for family in ("stiffness", "gain", "contact", "locked")),
    *((family, "height") for family in ("speed", "stiffness", "gain", "pitch")),
    *((family, "drift") for family in ("stiffness", "gain", "pitch", "locked")),
    ("stiffness", "sphere drift"),
    ("stiffness", "surface drift"),
    ("cell", "order"),
    ("seat", "rig"),
    ("seat", "surface"),
    ("fine", "rig"),
    ("quick", "rig"),
    *((family, "shot") for family in (
        "memory", "creep", "contact", "loss", "curve", "bend", "response",
    )),
)  # fmt: skip
"""(family, scope) that are asked."""


@dataclass(frozen=True)
class Located:
    """Where the structure of a residual lives and what repairs it."""

    slot: str
    """The likeliest."""
    probabilities: dict[str, float]
    """By slot."""
    gains: dict[str, float]
    """Fall of the whitened squares by the slot's best discrepancy, its numbers paid for; of
    held-out shots where it was learned."""
    discrepancy: Explained
    """The family with shared coefficients that explains most, to first order."""
    learned: Learned | None
    """The discrepancy that repairs held-out shots best."""
    structure: float
    """Whitened squares of the residual beyond what noise alone would leave."""
    formula: list[tuple[str, float]] = field(default_factory=list)
    """Label with group, and coefficient, of the few columns that hold on held-out shots, where so
    few do."""
    by_columns: Learned | None = None
    """As ``learned`` without the mean waveform, which says neither where a discrepancy lives nor
    what makes it."""
    mean: MeanWaveform | None = None
    """What the mean of other hits predicts; None where nobody asked."""

    @property
    def hardly_anywhere(self) -> bool:
        """Whether even the best slot's discrepancy explains little of the structure."""
        return self.gains[self.slot] < CRITERIA.half * self.structure

    @property
    def also(self) -> list[str]:
        """Return the other slots that the data cannot rule out."""
        least = CRITERIA.named_beside * self.probabilities[self.slot]
        odds = sorted(self.probabilities.items())
        return [slot for slot, p in odds if slot != self.slot and p >= least]


def locate(step: Step, progress: Progress) -> Located:
    """Return where the structure that a model leaves lives, and what repairs it.

    Where it lives is told to first order whatever the time: without a name it is the answer. Where
    the time is over, no discrepancy repairs it, or the best of those learned by then.
    """
    progress(MethodStep.VERDICT.told("where does it live?"), 0.0)
    whole = unwatched(step.problem)
    linearised = linearise(whole, step.fitted, wanted=FAMILIES)
    gains = gains_by_family(linearised)
    discrepancy = _explains_most(linearised, gains)
    before = heldout_or_none(whole, step.fitted)
    by_columns = best_discrepancy(step, linearised, gains, before, progress)
    known = gains | _heldout_gain(step, by_columns, before, predicted=gains)
    by_slot = gains_by_slot(known)
    odds = slot_probabilities(step.linearised, known)
    progress(MethodStep.VERDICT.told("is it better than a mean of the other hits?"), 0.99)
    mean = mean_waveform(whole, MOST_MODES)
    return Located(
        slot=max(odds, key=lambda slot: odds[slot]),
        probabilities=odds,
        gains=by_slot,
        discrepancy=discrepancy,
        learned=better(by_columns, waveform_discrepancy(step, mean), before),
        structure=max(structured_squares(step.linearised), *by_slot.values(), 1.0),
        formula=formula(linearised, discrepancy),
        by_columns=by_columns,
        mean=mean,
    )


def gains_by_family(linearised: Linearised) -> dict[Part, float]:
    """Return what each family of `BANK` explains to first order, its coefficients paid for.

    Linearised with `FAMILIES`; a family that cannot be solved for is left out.
    """
    found = {}
    for family, scope in BANK:
        if not linearised.families[family][0]:
            continue  # a rigid cell has no pitch
        try:
            answer = linearised.explain(family, scope, heldout=False)
        except np.linalg.LinAlgError:
            continue
        price = CRITERIA.price_of_coefficient * answer.dof
        found[family, scope] = max(answer.gain - price, 0.0)
    return found


def structured_squares(linearised: Linearised) -> float:
    """Return the whitened squares beyond what noise alone would leave."""
    return linearised.chi2 - sum(shot.item.expected_squares for shot in linearised.shots)


def slot_probabilities(linearised: Linearised, gains: Mapping[Part, float]) -> dict[str, float]:
    """Return how likely each slot is, by what families explain of this residual."""
    pairs = {(at.item.shot.sphere, at.item.shot.surface) for at in linearised.shots}
    spheres, surfaces = (set(materials) for materials in zip(*pairs, strict=True))
    pieces = min(len(pairs), len(spheres) + len(surfaces) - 1)
    return probabilities(gains, structured_squares(linearised), pieces)


def probabilities(gains: Mapping[Part, float], structure: float, pieces: int) -> dict[str, float]:
    """Return how likely each slot is: the likelihood above, of so many independent misfits.

    A family that explains more than the structure has seen all of it.
    """
    known = [
        (np.multiply(SHARES[family], SHARES_BY_SCOPE.get(scope, 1.0)), gain)
        for (family, scope), gain in gains.items()
        if family in SHARES
    ]
    if not known:
        return dict.fromkeys(SLOTS, 1.0 / len(SLOTS))
    shares, explained = (np.array(column) for column in zip(*known, strict=True))
    structure = max(structure, float(explained.max()), 1.0)
    left = 1.0 - explained / ((1.0 + FIRST_ORDER_ERROR) * structure + LEAST)
    likelihood = (left.min() / left) ** (0.5 * pieces)  # over the largest: no power overflows
    odds = (shares * likelihood[:, None]).max(axis=0)
    odds = (1.0 - UNLISTED) * odds / odds.sum() + UNLISTED / len(SLOTS)
    return dict(zip(SLOTS, map(float, odds), strict=True))


def gains_by_slot(gains: Mapping[Part, float]) -> dict[str, float]:
    """Return the most that anything which a slot can do explains."""
    by_slot = dict.fromkeys(SLOTS, 0.0)
    for (family, _), gain in gains.items():
        for slot, share in zip(SLOTS, SHARES.get(family, ()), strict=False):
            if share > 0.0:
                by_slot[slot] = max(by_slot[slot], gain)
    return by_slot


def _explains_most(linearised: Linearised, gains: Mapping[Part, float]) -> Explained:
    """Return the family with shared coefficients that explains most, the rig's where it does."""
    shared = [part for part in gains if part[1] != "shot" and part[0] != "speed"]
    most = max(shared, key=lambda part: gains[part])
    common = (most[0], "rig")
    if common in gains and (1.0 + CRITERIA.nothing) * gains[common] >= gains[most]:
        most = common
    return linearised.explain(*most)


def _heldout_gain(
    step: Step, learned: Learned | None, before: float | None, predicted: Mapping[Part, float]
) -> dict[Part, float]:
    """Return what a learned family explains, where known: the share of held-out shots' structure.

    That share is taken of the whole structure. On shots left out a model without the family errs by
    more than on those that it was fitted to: their squares are no measure of what the family
    explains beside those that were only tested. Of several families learned together only the first
    that no first order predicted has it.
    """
    if learned is None or not before or not learned.heldout_rms:
        return {}
    part = learned.parts[0]
    if part in predicted and len(learned.parts) > 1:
        return {}
    noise = float(np.mean([shot.item.noise.rms for shot in step.linearised.shots]))
    if before <= noise:
        return {}
    share = (before**2 - learned.heldout_rms**2) / (before**2 - noise**2)
    structure = max(structured_squares(step.linearised), *predicted.values(), 1.0)
    return {part: min(share, 1.0) * structure}


def formula(linearised: Linearised, discrepancy: Explained) -> list[tuple[str, float]]:
    """Return the few columns of a family that do nearly all of its work on held-out shots.

    Label with group, and coefficient; empty where more than `FORMULA_TERMS` are needed.
    """
    if discrepancy.scope == "shot" or discrepancy.heldout_gain <= 0:
        return []
    at, labels = linearised.families[discrepancy.family]
    chosen: list[int] = []
    for _ in range(min(FORMULA_TERMS, len(at))):
        tried = {}
        rest = [j for j in range(len(at)) if j not in chosen]
        for j in rest:
            which = [*chosen, j]
            part = ([at[i] for i in which], [labels[i] for i in which])
            families = {**linearised.families, "trial": part}
            trial = dataclasses.replace(linearised, families=families)
            tried[j] = trial.explain("trial", discrepancy.scope)
        best = max(tried, key=lambda j: tried[j].heldout_gain)
        chosen.append(best)
        if tried[best].heldout_gain > CRITERIA.nearly_all * discrepancy.heldout_gain:
            return list(tried[best].coefficients.items())
    return []
