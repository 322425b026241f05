"""Yield: linear beyond ``delta_y``, stiffer unloading on a shifted Hertz curve.

Source: Thornton 1997 (Johnson 1985, ch. 6): ``a_y = pi p_y R/(2 E*)``, ``delta_y = a_y^2/R``, slope
``pi R p_y``, unloading radius ``R_p = 4E*/(3F) ((2F + F_y)/(2 pi p_y))^(3/2)``. Perfectly
plastic, every touch on a fresh spot. Tell-tale: speed threshold, cut peak, lower rebound (tested).
"""

from __future__ import annotations

import math

from drivers.simulated import impact_kernel as kernel
from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class PlasticYield(Effect):
    """Yield of one material."""

    id = "plastic_yield"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter(
            "yield_pressure_pa", "Pa", 2.5e7, 1.4e8, math.inf, "p_y, contact pressure at yield"
        ),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if math.isinf(self.values["yield_pressure_pa"]):
            return
        mechanics.law = kernel.YIELDING
        mechanics.law_value = self.values["yield_pressure_pa"]
