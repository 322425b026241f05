"""Invented: the material warms up in the course of the campaign and softens or hardens.

Reduced modulus times ``1 + a (1 - exp(-n/n0))`` at the n-th release. Source: own; polymers lose a
percent of modulus in one or two kelvin. A drift between shots that no signal chain explains, as
contact times drift too. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class WarmingSphere(Effect):
    """A modulus that drifts between shots."""

    id = "x_warming_sphere"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("final_change", "1", 6e-4, 0.06, 0.0, "a", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 60.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the modulus."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        mechanics.reduced_modulus_pa *= 1.0 + self.values["final_change"] * settled
