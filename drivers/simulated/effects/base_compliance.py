"""The cell stands on a base mass on the stand's spring, and the crystal feels the difference.

Source: textbook two-mass chain (Den Hartog 1956). Tell-tale: slow ring, same for every sphere
(tested).
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class BaseCompliance(Effect):
    """A stand that gives way."""

    id = "base_compliance"
    slot = "sensor"
    parameters = (
        Parameter("frequency_hz", "Hz", 1e3, 1e4, 3e3, "of the base on its spring"),
        Parameter("damping_ratio", "1", 0.01, 0.15, 0.05, "of the base"),
        Parameter("base_mass_kg", "kg", 0.3, 300.0, math.inf, "of the base"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mass = self.values["base_mass_kg"]
        if math.isinf(mass):
            return
        w = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.base_mass_kg = mass
        mechanics.base_stiffness_n_per_m = mass * w * w
        mechanics.base_damping_n_s_per_m = 2.0 * self.values["damping_ratio"] * mass * w
