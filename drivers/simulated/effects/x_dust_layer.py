"""Invented: dust on the faces gives way at first touch and is crushed in the course of the drops.

Force times ``1 - a exp(-n/n0) exp(-delta/s)`` at the n-th release. Source: own. A soft toe that
heals. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import SOFT_TOE


class DustLayer(Effect):
    """Dust that is crushed."""

    id = "x_dust_layer"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 0.03, 0.9, 0.0, "a, of the force lost at touch"),
        Parameter("depth_m", "m", 1e-6, 1e-5, 3e-6, "s"),
        Parameter("drops_to_crush", "1", 5.0, 50.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        left = self.values["share"] * math.exp(-shot.number / self.values["drops_to_crush"])
        mechanics.terms.append(ContactTerm(SOFT_TOE, (left, self.values["depth_m"])))
