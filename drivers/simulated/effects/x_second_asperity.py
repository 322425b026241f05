"""Invented: beyond a gap a second spot touches, with a stiffness of its own.

Force plus ``b K (delta - gap)^(3/2)`` once ``delta > gap``. Source: own; two Hertz contacts in
parallel, one of them late (a burr, a dent, a grain). A kink in the rise whose depth is the same
at every speed. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import SECOND_SPOT


class SecondAsperity(Effect):
    """A second spot that touches late."""

    id = "x_second_asperity"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("share", "1", 3e-3, 0.5, 0.0, "b, stiffness over that of the first spot"),
        Parameter("gap_m", "m", 1e-6, 1.5e-5, 1e-5, "indentation at which it touches"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the spot to the force of contact."""
        mechanics.terms.append(
            ContactTerm(SECOND_SPOT, (self.values["share"], self.values["gap_m"]))
        )
