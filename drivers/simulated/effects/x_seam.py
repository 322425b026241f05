"""Invented: a moulded sphere lands now on its seam, now beside it.

Radius of the contact times ``exp(a z)``, z a standard normal number of each shot. Source: own.
Stiffness that is every shot's own, with the same losses and the same cell. Outside the library on
purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class Seam(Effect):
    """A sphere that is not round."""

    id = "x_seam"
    slot = "contact"
    per_material = True
    parameters = (Parameter("spread", "1", 5e-4, 0.1, 0.0, "a, of the radius in the logarithm"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the radius."""
        mechanics.sphere_radius_m *= math.exp(
            self.values["spread"] * float(shot.rng.standard_normal())
        )
