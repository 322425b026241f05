"""Invented: stiffness grows with the rate, force times ``1 + a (|delta'|/v1)^n``, v1 = 1 m/s.

Smoothed by one percent of v1 where the rate is zero. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import RATE_POWER


class PowerLawStiffness(Effect):
    """Rate-dependent stiffness of one material."""

    id = "x_power_law_stiffness"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("strength", "1", 0.002, 0.5, 0.0, "a, stiffening at 1 m/s"),
        Parameter("exponent", "1", 0.3, 1.5, 1.0, "n"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(
            ContactTerm(RATE_POWER, (self.values["strength"], 1.0, self.values["exponent"]))
        )
