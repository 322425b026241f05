"""One question: is there structure in the residual, or only noise? And if so, in which slot?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.discovery.evidence import Evidence, Explained

ALPHA = 2e-3
"""Chance, all families together, of calling a clean campaign discrepant."""

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
)

SLOTS: dict[str, tuple[tuple[str, str], ...]] = {
    "release": (("speed", "height"), ("speed", "shot")),
    "contact": (
        ("contact", "rig"),
        ("contact", "surface"),
        ("contact", "sphere"),
        ("loss", "rig"),
        ("loss", "surface"),
        ("stiffness", "drift"),
    ),
    "mounting": (("mode", "surface"), ("mode", "shot"), ("pitch", "surface"), ("pitch", "drift"),
                 ("seat", "rig")),
    "sensor": (("ringing", "rig"), ("bend", "rig"), ("creep", "rig"), ("path", "rig"),
               ("gain", "shot")),
    "electronics": (
        ("memory", "rig"),
        ("top", "rig"),
        ("curve", "rig"),
        ("dynamic", "rig"),
        ("droop", "rig"),
        ("gain", "drift"),
        ("swing", "shot"),
        ("clock", "shot"),
    ),
}  # fmt: skip
"""Whose closures bound what an effect of a slot could explain. Several slots share a behaviour, so
this does not decide which it is: `slots` does."""


@dataclass(frozen=True)
class Omnibus:
    """The answer to the one question.

    Attributes
    ----------
    p_value : float
        Of the strongest family, corrected for having asked them all.
    answers : dict
        What each family explains.
    """

    p_value: float
    answers: dict[tuple[str, str], Explained]

    @property
    def structured(self) -> bool:
        """Whether the residual is more than noise."""
        return self.p_value < ALPHA

    @property
    def strongest(self) -> Explained:
        """Return the family with the smallest p-value, then the largest gain per number."""
        return min(self.answers.values(), key=lambda e: (e.p_value, -e.gain / max(e.dof, 1)))


def ask(evidence: Evidence) -> Omnibus:
    """Return whether a fit's residual has structure.

    Parameters
    ----------
    evidence : Evidence
        Of the fit.

    Returns
    -------
    Omnibus
        p-value corrected by Bonferroni.
    """
    answers = {part: evidence.explain(*part, heldout=False) for part in ASKED}
    p = min(a.p_value for a in answers.values()) * len(answers)
    return Omnibus(float(np.minimum(p, 1.0)), answers)
