"""Invented: a crystal that is softer the harder it was struck, from the first moment on.

Stiffness of the cell times ``1 - a (v/v1)^2``, v the speed at touch-down, v1 = 0.77 m/s. Source:
own; conditioning of cracked and glued solids (Johnson & Jia 2005), which heals before the
next drop. Each shot has a pitch of its own. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

SPEED_M_PER_S = 0.77
LEAST = 0.3


class ConditionedCrystal(Effect):
    """A crystal that gives way to hard blows."""

    id = "x_conditioned_crystal"
    slot = "sensor"
    parameters = (
        Parameter("softening", "1", 1e-4, 0.05, 0.0, "a, of stiffness at v1", either_sign=True),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the crystal's stiffness."""
        lost = self.values["softening"] * (speed_m_per_s / SPEED_M_PER_S) ** 2
        mechanics.cell_stiffness_n_per_m *= max(1.0 - lost, LEAST)
