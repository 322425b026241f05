r"""Which slot? What each family of columns leaves of a residual, and whose work such columns are.

A family k explains :math:`g_k` of the T structured whitened squares, its coefficients paid for, and
leaves the share

.. math:: l_k = \frac{(1 + e) T - g_k + c}{(1 + e) T + c} .

What is left is a misfit whose size nobody knows, and one pair's is one piece of it. Integrated over
that size, with n pairs, its likelihood is

.. math:: L_k \propto l_k^{-n/2}, \qquad p_s \propto \max_k M_{ks} L_k ,

where M is how usual a change of kind k is for the slot s: a share written by hand, none where the
slot cannot do it. What two slots do alike (a memoryless curve: the crystal or the converter) stands
under both, and where no family explains much all slots are as likely. Nothing here was trained.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.linearised import Explained, Linearised
from analysis.effects.effect import SLOTS

Array = NDArray[np.float64]
Part = tuple[str, str]

SHARES: dict[str, tuple[float, float, float, float, float]] = {
    #            release contact mounting sensor electronics
    "speed":     (1.0,    0.0,    0.0,     0.0,   0.0),  # of the impact, against its height
    "stiffness": (0.0,    1.0,    0.0,     0.0,   0.0),
    "contact":   (0.0,    1.0,    0.0,     0.0,   0.0),  # a force over indentation and rate
    "loss":      (0.0,    1.0,    0.0,     0.0,   0.0),
    "pitch":     (0.0,    0.0,    1.0,     0.8,   0.0),  # what rides on the crystal, or itself
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
"""By family, in the order of `SLOTS`. ``locked`` follows anything, and is nobody's."""

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

LEAST = 10.0
"""Whitened squares that chance brings."""
FIRST_ORDER_ERROR = 0.02
"""Share of what they describe that a first order and columns in steps leave."""


def explained_by_family(linearised: Linearised) -> dict[Part, Explained]:
    """Return what each family of `BANK` explains, to first order.

    Parameters
    ----------
    linearised : Linearised
        Gathered with `FAMILIES`.

    Returns
    -------
    dict
        By (family, scope); a family that cannot be solved for is left out.
    """
    found = {}
    for family, scope in BANK:
        if not linearised.families[family][0]:
            continue  # a rigid cell has no pitch
        try:
            found[family, scope] = linearised.explain(family, scope, heldout=False)
        except np.linalg.LinAlgError:
            continue
    return found


def worth(found: Explained) -> float:
    """Return a gain with its coefficients paid for. [1]"""
    return max(found.gain - CRITERIA.discrepancy.price_of_coefficient * found.dof, 0.0)


def gains_by_slot(gains: Mapping[Part, float]) -> dict[str, float]:
    """Return the most that anything which a slot can do explains."""
    return {
        slot: max(
            (g for (family, _), g in gains.items() if _share(family, slot) > 0.0), default=0.0
        )
        for slot in SLOTS
    }


def _share(family: str, slot: str) -> float:
    return SHARES[family][SLOTS.index(slot)] if family in SHARES else 0.0


def probabilities(gains: Mapping[Part, float], structure: float, pairs: int) -> dict[str, float]:
    """Return how likely each slot is.

    Parameters
    ----------
    gains : mapping
        By (family, scope), coefficients paid for.
    structure : float
        Whitened squares beyond noise; what explains more has seen them all.
    pairs : int
        Pairs of sphere and surface that were dropped.

    Returns
    -------
    dict
        Slot to probability.
    """
    owned = [(SHARES[family], gain) for (family, _), gain in gains.items() if family in SHARES]
    if not owned:
        return dict.fromkeys(SLOTS, 1.0 / len(SLOTS))
    shares, explained = (np.array(column) for column in zip(*owned, strict=True))
    whole = (1.0 + FIRST_ORDER_ERROR) * max(structure, float(explained.max())) + LEAST
    likelihood = (1.0 - explained / whole) ** (-0.5 * pairs)
    odds = (shares * (likelihood / likelihood.max())[:, None]).max(axis=0)
    return dict(zip(SLOTS, map(float, odds / odds.sum()), strict=True))
