"""Invented: the coupon's tape stiffens as it is squeezed, as any thin soft layer does.

Force of the tape ``k_t q (1 + q/q1)``, q its compression, linear in tension. Source: own, first
term of a confined layer. Ring and pulse shift with the coupon, and more in hard blows. Outside the
library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

DAMPING_RATIO = 0.1
MASS_KG = 4e-3  # of the coupon that the damping ratio is meant for


class StiffeningTape(Effect):
    """A tape that stiffens."""

    id = "x_stiffening_tape"
    slot = "mounting"
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 5e6, 5e8, math.inf, "k_t at rest"),
        Parameter("depth_m", "m", 5e-8, 5e-6, 1e-6, "q1, compression that doubles it"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        stiffness = self.values["stiffness_n_per_m"]
        if math.isinf(stiffness):
            return
        mechanics.coupon_mass_kg = mechanics.coupon_label_mass_kg
        mechanics.layer_stiffness_n_per_m = stiffness
        mechanics.layer_damping_n_s_per_m = 2.0 * DAMPING_RATIO * math.sqrt(stiffness * MASS_KG)
        mechanics.layer_hardening_per_m = 1.0 / self.values["depth_m"]
