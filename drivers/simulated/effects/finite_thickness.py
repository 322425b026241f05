"""A thin bonded coupon stiffens: K times ``1 + 1.133X + 1.283X^2 + 0.769X^3 + 0.0975X^4``.

``X = sqrt(R delta)/h``. Source: Dimitriadis et al. 2002, nearly incompressible bonded layer, X < 1.
Tell-tale: hardens with amplitude, shorter contact (tested).
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import THICKNESS


class FiniteThickness(Effect):
    """A coupon of finite thickness."""

    id = "finite_thickness"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("thickness_m", "m", 1e-3, 5e-2, math.inf, "h, thickness of the coupon"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(THICKNESS, (self.values["thickness_m"],)))
