"""Viscoelastic loss in the bulk: ``(3/2) A K sqrt(delta) delta'`` more on the sphere.

Source: Kuwabara & Kono 1987; Brilliantov et al. 1996. Quasi-static viscoelastic spheres, A short
against the contact. Tell-tale: the loss grows with speed, 1 - eps ~ v^(1/5) (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import KUWABARA_KONO


class ViscoelasticDamping(Effect):
    """Kuwabara-Kono damping of one material."""

    id = "viscoelastic_damping"
    slot = "contact"
    per_material = True
    parameters = (Parameter("relaxation_s", "s", 1e-7, 1e-5, 0.0, "A, the dissipative constant"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(KUWABARA_KONO, (self.values["relaxation_s"],)))
