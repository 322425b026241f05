"""The coupon recedes like an endless plate: ``w' = F/Z``, F the whole force of contact.

Source: Zener 1941; plate wide against the flexural wave, no echo from its rim. Tell-tale: lower
rebound without ringing (tested).
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class PlateRadiation(Effect):
    """A coupon that radiates flexural waves."""

    id = "plate_radiation"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("impedance_n_s_per_m", "N s/m", 50.0, 5000.0, math.inf, "Z of the plate"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if not math.isinf(self.values["impedance_n_s_per_m"]):
            mechanics.plate_impedance_n_s_per_m = self.values["impedance_n_s_per_m"]
