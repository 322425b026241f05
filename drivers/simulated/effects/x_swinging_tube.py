"""Invented: the tube still moves up or down when it lets go, and the sphere takes that along.

Impact speed ``v0 + a z``, z a standard normal number of each shot: the same metres per second at
every height, hence worst at low drops. Source: own. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

GRAVITY_M_PER_S2 = 9.81  # only scales the size


class SwingingTube(Effect):
    """A tube that swings."""

    id = "x_swinging_tube"
    slot = "release"
    parameters = (
        Parameter("speed_m_per_s", "m/s", 2e-3, 0.06, 0.0, "a, of the tube at the release"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        free = math.sqrt(2.0 * GRAVITY_M_PER_S2 * shot.drop_height_m)
        shot.speed_factor *= (
            1.0 + self.values["speed_m_per_s"] * float(shot.rng.standard_normal()) / free
        )
