"""Invented: a loose screw below the coupon pushes back at once and pulls back hardly at all.

A small mass on the crystal's top behind a spring that is a fifth as stiff when stretched: kicked
away by the impact, back after longer than its own period. Source: own; bilinear oscillator (Shaw
& Holmes 1983). Extra ring that is no sine and whose pitch follows no linear mode. Outside the
library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

STRETCHED_STIFFNESS_RATIO = 0.2
DAMPING_RATIO = 0.03


class RattlingScrew(Effect):
    """A screw that rattles."""

    id = "x_rattling_screw"
    slot = "mounting"
    parameters = (
        Parameter("mass_ratio", "1", 1e-5, 0.02, 0.0, "mass of the screw over the crystal's"),
        Parameter("frequency_hz", "Hz", 3e3, 3e4, 1e4, "of the screw while it is pushed"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.mode_mass_kg = self.values["mass_ratio"] * mechanics.cell_mass_kg
        mechanics.mode_angular_frequency_rad_per_s = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.mode_damping_ratio = DAMPING_RATIO
        mechanics.mode_stretched_ratio = STRETCHED_STIFFNESS_RATIO
