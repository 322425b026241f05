"""Invented: a material that rubs in itself resists on the way in and holds back on the way out.

Force times ``1 + h`` while the contact closes and ``1 - h`` while it opens, joined over 2 cm/s.
Source: loss without a rate, two slopes as in Walton & Braun 1986. The force falls at the deepest
point, the same share is lost at every speed, and the crystal feels all of it. Outside the
library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import SNAP

EVERYWHERE_M = 1.0  # a snap as wide as this has no depth of its own


class InternalFriction(Effect):
    """Loss that knows no rate."""

    id = "x_internal_friction"
    slot = "contact"
    per_material = True
    parameters = (Parameter("share", "1", 1e-3, 0.15, 0.0, "h, of the force"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Weaken the way out and strengthen the way in: a snap of the other sign, everywhere."""
        share = self.values["share"]
        mechanics.reduced_modulus_pa *= 1.0 - share
        stronger = -2.0 * share / (1.0 - share)
        mechanics.terms.append(ContactTerm(SNAP, (stronger, 0.0, EVERYWHERE_M)))
