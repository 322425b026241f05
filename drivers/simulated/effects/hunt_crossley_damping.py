"""Loss in proportion to force and rate: ``chi K delta^(3/2) delta'`` more on the sphere.

Source: Hunt & Crossley 1975. Small losses. Tell-tale: 1 - eps ~ v (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import HUNT_CROSSLEY


class HuntCrossleyDamping(Effect):
    """Hunt-Crossley damping of one material."""

    id = "hunt_crossley_damping"
    slot = "contact"
    per_material = True
    parameters = (Parameter("damping_s_per_m", "s/m", 0.02, 0.5, 0.0, "chi"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(HUNT_CROSSLEY, (self.values["damping_s_per_m"],)))
