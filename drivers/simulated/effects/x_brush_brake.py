"""Invented: something at the tube's end takes the same speed from every drop.

Speed ``v - d``, whatever the height. Source: own; a viscous brake of fixed length, as a magnet at
the end of the tube makes it: force in proportion to speed, momentum lost in proportion to
the way. Neither a height nor a share of the speed. Outside the library on purpose:
a law that wrong heights are held against, never a name.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

GRAVITY_M_PER_S2 = 9.80665


class BrushBrake(Effect):
    """A brake at the tube's end."""

    id = "x_brush_brake"
    slot = "release"
    parameters = (
        Parameter("lost_m_per_s", "m/s", 1e-3, 0.06, 0.0, "d, speed lost", either_sign=True),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the speed."""
        speed = math.sqrt(2.0 * GRAVITY_M_PER_S2 * shot.drop_height_m)
        shot.speed_factor *= max(1.0 - self.values["lost_m_per_s"] / speed, 0.05)
