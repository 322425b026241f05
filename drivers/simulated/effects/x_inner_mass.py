"""Invented: the sphere rings in itself while it touches.

A part ``r`` of its mass hangs on a spring inside it, of frequency ``f``. Source: own; the lowest
mode of a body as one mass and one spring. Heard in the contact only: it is silent for the cell
where the sphere leaves. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

DAMPING_RATIO = 0.03


class InnerMass(Effect):
    """A sphere that is not one mass."""

    id = "x_inner_mass"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 2e-3, 0.3, 0.0, "r, of the sphere's mass"),
        Parameter("frequency_hz", "Hz", 8e3, 6e4, 2e4, "f of the mass inside, the rest held"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.inner_mass_share = self.values["share"]
        mechanics.inner_angular_frequency_rad_per_s = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.inner_damping_ratio = DAMPING_RATIO
