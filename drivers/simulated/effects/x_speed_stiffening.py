"""Invented: a material that is stiffer the faster it is hit, all through the contact.

Reduced modulus times ``(v/v1)^n``, v the speed at touch-down, v1 = 0.77 m/s. Source: own; power
law in the rate of strain, as polymers show over decades. Each shot by itself is the base model.
Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

SPEED_M_PER_S = 0.77


class SpeedStiffening(Effect):
    """A modulus that grows with the speed of impact."""

    id = "x_speed_stiffening"
    slot = "contact"
    per_material = True
    parameters = (Parameter("exponent", "1", 5e-4, 0.1, 0.0, "n", either_sign=True),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the modulus."""
        ratio = speed_m_per_s / SPEED_M_PER_S
        mechanics.reduced_modulus_pa *= ratio ** self.values["exponent"]
