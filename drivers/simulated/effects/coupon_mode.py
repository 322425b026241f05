"""An oscillator on the crystal's top: the coupon rocks or bends.

Its mass differs from shot to shot with the place that was hit. Source: textbook tuned absorber
(Den Hartog 1956). Tell-tale: a second line in the ring, amplitude varies (tested).
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class CouponMode(Effect):
    """A mode of the coupon."""

    id = "coupon_mode"
    slot = "mounting"
    per_material = True
    parameters = (
        Parameter("frequency_hz", "Hz", 5e3, 6e4, 2e4, "of the mode"),
        Parameter("damping_ratio", "1", 0.005, 0.05, 0.02, "of the mode"),
        Parameter("mass_ratio", "1", 5e-4, 0.15, 0.0, "modal mass over the crystal's"),
        Parameter("hit_scatter", "1", 0.05, 0.4, 0.0, "relative scatter of the mass by shot"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        scatter = math.exp(self.values["hit_scatter"] * shot.rng.standard_normal())
        mechanics.mode_mass_kg = self.values["mass_ratio"] * mechanics.cell_mass_kg * scatter
        mechanics.mode_angular_frequency_rad_per_s = 2.0 * math.pi * self.values["frequency_hz"]
        mechanics.mode_damping_ratio = self.values["damping_ratio"]
