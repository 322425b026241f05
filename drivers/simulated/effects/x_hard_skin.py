"""Invented: a sphere or coupon with a hard skin, stiff at first and soft once it is through.

Force times ``1 + a exp(-delta/s)``. Source: own; the first term of a contact that feels a thin
layer less and less as it grows beyond it. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import SOFT_TOE


class HardSkin(Effect):
    """A coating that is stiffer than what it covers."""

    id = "x_hard_skin"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 0.01, 3.0, 0.0, "a, of the force, more at first touch"),
        Parameter("depth_m", "m", 1e-6, 2e-5, 5e-6, "s"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact: a soft toe of the other sign."""
        values = (-self.values["share"], self.values["depth_m"])
        mechanics.terms.append(ContactTerm(SOFT_TOE, values))
