"""One question: is there structure in the residual, or only noise?"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from scipy.stats import norm

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.score_test.baseline_wander import p_of_wander
from analysis.diagnosis.score_test.family_wise import family_wise
from analysis.diagnosis.score_test.linearised import LAW, Explained, Linearised

WANDER = ("baseline", "shot")
"""What slow noise does too, which may be too faint to be seen before the trigger."""
MEASURED = "pre-trigger"
"""Noise whose level is known from quiet stretches."""

ASKED: tuple[tuple[str, str], ...] = (
    ("response", "rig"),
    ("response", "surface"),
    ("static", "rig"),
    ("dynamic", "rig"),
    ("contact", "rig"),
    ("contact", "surface"),
    ("contact", "sphere"),
    ("loss", "rig"),
    ("loss", "surface"),
    ("cell", "surface"),
    ("cell", "order"),
    ("cell", "shot"),
    ("speed", "height"),
    ("speed", "shot"),
    ("locked", "rig"),
    ("locked", "pair"),
    ("alternate", "shot"),
    ("baseline", "shot"),
)

INEXACT = (LAW, "pair")
"""Asked of a model with effects: is one of its laws wrong by more than laws are?"""


@dataclass(frozen=True)
class ScoreTest:
    """The answer to the one question.

    Attributes
    ----------
    p_value : float
        Of the strongest family, corrected for having asked them all: uniform where there is only
        noise, at least the chance of it where there is structure.
    answers : dict
        What each family explains.
    surplus : float
        Whitened squares beyond the noise's own, where these are too many for noise. No family need
        have seen them.
    """

    p_value: float
    answers: dict[tuple[str, str], Explained]
    surplus: float = 0.0

    @property
    def structured(self) -> bool:
        """Whether the residual is more than noise."""
        return self.p_value < CRITERIA.structure.false_alarm_rate

    @property
    def left(self) -> float:
        """Return the whitened squares that are no noise, as far as anything sees them."""
        return max(self.surplus, *(a.gain - a.dof for a in self.answers.values()))

    @property
    def strongest(self) -> Explained:
        """Return the family with the smallest p-value, then the largest gain per number."""
        return min(self.answers.values(), key=lambda e: (e.p_value, -e.gain / max(e.dof, 1)))


def run_score_test(linearised: Linearised) -> ScoreTest:
    """Return whether a fit's residual has structure.

    Parameters
    ----------
    linearised : Linearised
        Of the fit.

    Returns
    -------
    ScoreTest
        Its p-value.

    Notes
    -----
    Bonferroni's correction is an upper bound. Where it calls a residual structured already, it
    stands; else the chance is asked of noise that is drawn.
    """
    asked = (*ASKED, INEXACT) if linearised.wrong_by else ASKED
    answers = {part: linearised.explain(*part, heldout=False) for part in asked}
    wander = answers[WANDER]
    if wander.p_value < CRITERIA.structure.false_alarm_rate:
        p = max(wander.p_value, p_of_wander(linearised))
        answers[WANDER] = dataclasses.replace(wander, p_value=p)
    surplus, p_of_surplus = _surplus(linearised)
    least = min(a.p_value for a in answers.values())
    p = min(p_of_surplus, least) * len(answers)
    if not p < CRITERIA.structure.false_alarm_rate:
        p = family_wise(least, linearised, asked)
    return ScoreTest(p, answers, surplus)


def _surplus(linearised: Linearised) -> tuple[float, float]:
    """Return the squares beyond the noise's own and their p-value; 0 and 1 of what noise may have.

    Samples and level are uncertain as those of Gaussian noise are.
    """
    noises = {id(shot.item.noise): shot.item.noise for shot in linearised.shots}.values()
    if any(noise.source != MEASURED for noise in noises):
        return 0.0, 1.0
    seen = sum(shot.white.size for shot in linearised.shots)
    sigma = math.sqrt(2.0 / seen + 2.0 / sum(noise.samples for noise in noises))
    share = linearised.chi2 / seen - 1.0
    if not share > max(
        CRITERIA.structure.surplus_share, CRITERIA.structure.surplus_deviations * sigma
    ):
        return 0.0, 1.0
    return share * seen, float(norm.sf(share / sigma))
