"""Invented: the sphere has a flat or a tip, and the exponent is not that of a sphere.

Force times ``(delta/d1)^n``, d1 = 10 um: n = 1/2 is a cone, n = -1/2 a flat. Source: Sneddon
1965, between his two cases. Wrong at every speed in a way that no stiffness mends. Outside the
library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import POWER

INDENTATION_M = 1e-5


class ConicalTip(Effect):
    """Another exponent of the force."""

    id = "x_conical_tip"
    slot = "contact"
    per_material = True
    parameters = (Parameter("exponent", "1", 1e-3, 0.2, 0.0, "n, beyond 3/2", either_sign=True),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(POWER, (self.values["exponent"], INDENTATION_M)))
