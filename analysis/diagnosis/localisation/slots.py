r"""Which slot? What generic families explain, judged by physics and by simulated campaigns.

For each family k of `BANK` the score test gives how far the whitened squares fall, g_k, twice the
number of coefficients taken off. What counts is how much of the best a family leaves:

.. math::

    x_k = -\log_{10} \frac{1.02\, g_{max} - g_k + 10}{1.02\, g_{max} + 10}, \qquad
    p_s \propto \exp\Big(2 u_s + b_s + \sum_k w_{sk} \frac{x_k - m_k}{d_k}\Big)

u_s is `slot_physics`: which part of an instrument can do such a thing at all. The rest is learned
from simulated effects, and knows best what resembles them; two numbers stand beside the x_k there:
how much slow power there is before the trigger, and log g_max. The table of b, w, m, d is in
`slot_table`, with how it was made and how well both do together, and each without the other.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.localisation.slot_physics import physical_score
from analysis.diagnosis.localisation.slot_table import BIAS, CENTRE, SLOT_NAMES, SPREAD, WEIGHTS
from analysis.diagnosis.score_test.linearised import Explained, Linearised
from analysis.fit.problem import FitShot
from analysis.fit.window import quiet_part

Array = NDArray[np.float64]
Part = tuple[str, str]

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
"""(family, scope) in the order of the table."""

LEAST = 10.0
"""Whitened squares that chance brings."""
CALM_TERMS = 16
"""Slowest cosines of the quiet part that are looked at."""
FAITH_IN_PHYSICS = 2.5
"""How sharply the physical score counts beside what was learned."""
MOST_SLOW_POWER = 1.0


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


def slow_power(shots: list[FitShot]) -> float:
    """Return the whitened power of the slowest part of the quiet stretch, 1 for plain noise."""
    squares: list[float] = []
    for item in shots:
        quiet = item.window.polarity * quiet_part(item.shot)
        if quiet.size < CRITERIA.noise.least_quiet_samples:
            continue
        place = (np.arange(quiet.size) + 0.5) / quiet.size
        slow = np.cos(np.pi * np.outer(place, np.arange(1, CALM_TERMS + 1)))
        basis, _ = np.linalg.qr(item.noise.whiten(slow))
        squares += list(np.square(basis.T @ item.noise.whiten(quiet - quiet.mean())))
    return float(np.mean(squares)) if squares else 1.0


def features(answers: dict[Part, Explained], shots: list[FitShot]) -> Array:
    """Return the numbers that tell slots apart. Shape (len(BANK) + 2,).

    Parameters
    ----------
    answers : dict
        From `explained_by_family`.
    shots : list of FitShot
        With their quiet stretches.
    """
    gains = np.array([worth(answers[k]) if k in answers else 0.0 for k in BANK])
    most = max(float(gains.max()), LEAST)
    left = (1.02 * most - gains + LEAST) / (1.02 * most + LEAST)
    calm = min(max(math.log(max(slow_power(shots), 1.0)), 0.0), MOST_SLOW_POWER)
    return np.array([*(-np.log10(left)), calm, math.log10(most) - 3.0])


def probabilities(found: Array) -> dict[str, float]:
    """Return how likely each slot is.

    Parameters
    ----------
    found : ndarray, shape (f,)
        From `features`.

    Returns
    -------
    dict
        Slot to probability.
    """
    physics = physical_score(found[: len(BANK)], [family for family, _ in BANK])
    score = FAITH_IN_PHYSICS * physics + BIAS + WEIGHTS @ ((found - CENTRE) / SPREAD)
    odds = np.exp(score - score.max())
    return dict(zip(SLOT_NAMES, map(float, odds / odds.sum()), strict=True))
