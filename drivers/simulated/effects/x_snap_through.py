"""Invented: a domed coupon snaps flat on the way in and does not snap back on the way out.

Force times ``1 - a exp(-((delta - d)/(d/3))^2)`` while the contact closes, as it was while it
opens, joined over 2 cm/s. Source: own, in the spirit of shallow arches (Timoshenko & Gere 1961,
ch. 7). A notch in the rise at the same depth in every shot. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import SNAP


class SnapThrough(Effect):
    """A coupon that snaps flat."""

    id = "x_snap_through"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 2e-3, 0.2, 0.0, "a, loss of force at the snap"),
        Parameter("depth_m", "m", 2e-6, 2e-5, 1e-5, "d, indentation of the snap"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the snap to the force of contact."""
        depth = self.values["depth_m"]
        mechanics.terms.append(ContactTerm(SNAP, (self.values["share"], depth, depth / 3.0)))
