r"""Which part of an instrument can do what a family of columns describes.

No weights but shares written down by hand: one where a change of that kind is what the slot does,
less where it is a less usual work of the slot, none where it cannot be. What two slots do alike (a
memoryless curve: the crystal or the converter) stands under both, and the answer says so. With
:math:`r_k` what the family k explains over the most that any owned family does,

.. math:: u_s = \max_k M_{ks} r_k^4 .

``locked`` and the residual's size say nothing about where, and are left out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

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
}  # fmt: skip
"""By family, in the order of `slot_table.SLOT_NAMES`."""

SHARES_BEYOND_FIRST_ORDER: dict[str, tuple[float, float, float, float, float]] = {
    #            release contact mounting sensor electronics
    "slew":      (0.0,    0.0,    0.0,     0.0,   1.0),
    "jump":      (0.0,    0.0,    0.0,     0.0,   1.0),
    "ripple":    (0.0,    0.0,    0.0,     0.0,   1.0),
    "alternate": (0.0,    0.0,    0.0,     0.0,   1.0),
    "warmth":    (0.0,    0.0,    0.0,     0.8,   1.0),
    "blow":      (0.7,    0.0,    1.0,     0.0,   0.0),  # something lands, or the sphere does
}  # fmt: skip
"""The same of discrepancies that no first order foretells, for what only they explain."""

NOBODYS = (0.0,) * 5
POWER = 4.0
"""So much sharper than in proportion is the lead of what explains most."""
DOUBT = 0.1
"""Share of a slot that cannot be, as far as anybody knows."""
LITTLE = 0.2
"""Decades of fall that count as an explanation at all."""


def physical_score(explained: Array, families: Sequence[str]) -> Array:
    """Return how well each slot's own work explains a residual, 0 to 1. Shape (5,).

    Parameters
    ----------
    explained : ndarray, shape (k,)
        By how many decades each family lets the residual fall.
    families : sequence of str
        Their names; those that are not in `SHARES` belong to nobody.
    """
    shares = np.array([SHARES.get(family, NOBODYS) for family in families])
    owned = shares.max(axis=1) > 0.0
    share_of_most = explained / max(float(explained[owned].max(initial=0.0)), LITTLE)
    return np.asarray((shares * (share_of_most**POWER)[:, None]).max(axis=0, initial=0.0))


def odds_beyond_first_order(family: str) -> Array | None:
    """Return how likely each slot is where only one family beyond first order explains a residual.

    Parameters
    ----------
    family : str
        Of the discrepancy.

    Returns
    -------
    ndarray, shape (5,), or None
        Sum one; None of a family that a first order foretells.
    """
    if family not in SHARES_BEYOND_FIRST_ORDER:
        return None
    shares = np.array(SHARES_BEYOND_FIRST_ORDER[family]) + DOUBT
    return np.asarray(shares / shares.sum())
