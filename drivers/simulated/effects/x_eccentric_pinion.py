"""Invented: the pinion that lifts the tube along its rack sits off its axle.

Height ``h + a sin(2 pi h/p)``, p the way of one turn, the scale set to zero on the coupon. Source:
own; an eccentric gear, as in any table of errors of measuring machines. Each height is wrong by an
amount of its own, now too high, now too low, and the same in every drop. Outside the library on
purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

LEAST_SHARE = 0.1


class EccentricPinion(Effect):
    """A scale with a periodic error."""

    id = "x_eccentric_pinion"
    slot = "release"
    parameters = (
        Parameter("eccentricity_m", "m", 2e-5, 1.5e-3, 0.0, "a", either_sign=True),
        Parameter("turn_m", "m", 0.012, 0.07, 0.03, "p, way of one turn"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the height."""
        h = shot.drop_height_m
        error = self.values["eccentricity_m"] * math.sin(2.0 * math.pi * h / self.values["turn_m"])
        shot.drop_height_m = max(h + error, LEAST_SHARE * h)
