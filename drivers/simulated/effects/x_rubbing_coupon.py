"""Invented: the coupon's edge rubs against the frame that centres it.

A force ``f tanh(v/v1)`` against the motion of the crystal's top, v1 = 0.1 mm/s. Source: Coulomb's
law, smoothed. The ring dies in a straight line and not exponentially, the smaller the sooner.
Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class RubbingCoupon(Effect):
    """A coupon that rubs."""

    id = "x_rubbing_coupon"
    slot = "mounting"
    per_material = True
    parameters = (Parameter("friction_n", "N", 2e-3, 0.6, 0.0, "f"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.rubbing_n = self.values["friction_n"]
