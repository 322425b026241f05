"""The law of a thin coupon in its own words, for references integrated in time."""

from __future__ import annotations

import math
from typing import Any

from scipy.optimize import brentq

from analysis.effects.finite_thickness import _presses_more, _sinks_less

from .conftest import Rig
from .reference import Law


def thin_coupon(rig: Rig, thickness_m: float) -> Law:
    """Return the law in its own words: the radius of contact by bracketing, forces in series."""
    k, radius, share, nu = rig.stiffness, rig.radius, rig.coupon_share, rig.poissons_ratio
    whole = 0.75 * k / math.sqrt(radius)

    def depth(a: float) -> float:
        e = a / thickness_m
        both = 1.0 / ((1.0 - share) + share / _presses_more(e, nu))
        sphere = (1.0 - share) * both  # its part in the curvature
        return a**2 / radius * (sphere + (1.0 - sphere) * (1.0 - _sinks_less(e, nu)))

    def law(d: float, r: float, z: Any) -> tuple[float, float, tuple[()]]:
        if d <= 0.0:
            return 0.0, 0.0, ()
        guess = math.sqrt(radius * d)
        a = brentq(lambda x: depth(x) - d, 0.9 * guess, 3.0 * guess, xtol=1e-18, rtol=1e-15)
        both = whole / ((1.0 - share) + share / _presses_more(a / thickness_m, nu))
        return 4.0 * a**3 / (3.0 * radius) * both, rig.dashpot(d, r), ()

    return law
