"""Invented: the stand gives way and rubs on what it stands on, until friction holds it.

A base mass on a spring of frequency ``f``, with dry friction ``F`` and hardly a dashpot. Source:
own; oscillator with Coulomb's friction (Den Hartog 1931). Its ring falls by equal steps and ends.
Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

DAMPING_RATIO = 0.005


class DryStand(Effect):
    """A stand that rubs."""

    id = "x_dry_stand"
    slot = "sensor"
    parameters = (
        Parameter("base_mass_kg", "kg", 0.1, 30.0, math.inf, "of the stand"),
        Parameter("frequency_hz", "Hz", 500.0, 5e3, 2e3, "f of the stand on its spring"),
        Parameter("friction_n", "N", 0.03, 3.0, 0.0, "F"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mass, w = self.values["base_mass_kg"], 2.0 * math.pi * self.values["frequency_hz"]
        if math.isinf(mass):
            return
        mechanics.base_mass_kg = mass
        mechanics.base_stiffness_n_per_m = mass * w * w
        mechanics.base_damping_n_s_per_m = 2.0 * DAMPING_RATIO * mass * w
        mechanics.base_friction_n = self.values["friction_n"]
