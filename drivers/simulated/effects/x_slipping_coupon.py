"""Invented: a coupon slides on its tape in steps, until somebody pushes it back.

The mass that rides on the crystal changes by ``a (floor(n/N) mod 3)`` of the crystal's at the n-th
release. Source: own. The ring's pitch jumps up and down between drops, on the coupons concerned.
Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class SlippingCoupon(Effect):
    """A coupon that moves on its tape."""

    id = "x_slipping_coupon"
    slot = "mounting"
    per_material = True
    parameters = (
        Parameter("mass_share", "1", 2e-4, 0.02, 0.0, "a, of one step", either_sign=True),
        Parameter("drops_between", "1", 4.0, 15.0, 8.0, "N"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        steps = math.floor(shot.number / self.values["drops_between"]) % 3
        mechanics.cell_mass_kg *= 1.0 + self.values["mass_share"] * steps
