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
    ),
    "mounting": (("response", "surface"), ("cell", "surface")),
    "sensor": (("ringing", "rig"), ("bend", "rig")),
    "electronics": (
        ("memory", "rig"),
        ("top", "rig"),
        ("dynamic", "rig"),
        ("cell", "order"),
        ("cell", "shot"),
    ),
}
"""Whose closures stand for which slot. A chain that rings is taken for the sensor, one that delays,
decays or tops out for the electronics; where neither is much better, neither is named alone."""

LOCATING = tuple(f for families in SLOTS.values() for f in families)


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


def ask(evidence: Evidence, *, heldout: bool = False) -> Omnibus:
    """Return whether a fit's residual has structure.

    Parameters
    ----------
    evidence : Evidence
        Of the fit.
    heldout : bool
        Also compute each family's gain on held-out shots, and ask those that locate.

    Returns
    -------
    Omnibus
        p-value corrected by Bonferroni.
    """
    answers = {}
    for family, scope in ASKED:
        answers[family, scope] = evidence.explain(family, scope, heldout=heldout)
    p = min(a.p_value for a in answers.values()) * len(answers)
    if heldout:
        for family, scope in LOCATING:
            if (family, scope) not in answers:
                answers[family, scope] = evidence.explain(family, scope)
    return Omnibus(float(np.minimum(p, 1.0)), answers)
