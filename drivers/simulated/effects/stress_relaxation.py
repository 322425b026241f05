"""Standard linear solid: ``g K (delta^(3/2) - z)`` more force, ``z' = (delta^(3/2) - z)/tau``.

Source: Lee & Radok 1960, with one relaxation time and the indentation in place of the contact
area's history, so valid while loading. The force is carried by the body, hence felt by the crystal.
Tell-tale: stiffer when the contact is short against tau (tested in both limits).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import RELAXATION


class StressRelaxation(Effect):
    """Stress relaxation of one material."""

    id = "stress_relaxation"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("strength", "1", 0.01, 0.4, 0.0, "g, glassy over relaxed stiffness less one"),
        Parameter("relaxation_time_s", "s", 1e-6, 1e-4, 1e-5, "tau"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(
            ContactTerm(RELAXATION, (self.values["strength"], self.values["relaxation_time_s"]))
        )
