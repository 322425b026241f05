"""Asperities soften the first touch: force times ``1 - exp(-delta/s)``.

Source: own form, Hertz from the plane of the first touch once the asperities are flat. Greenwood &
Tripp 1967, whose bulk is met some heights below that plane, is another law, and its opposite in
sign: against the Hertz curve of the heavy loads it presses more at first, this form less. Not
validated against measured roughness. Tell-tale: soft toe, worse at low speed (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import ROUGHNESS


class SurfaceRoughness(Effect):
    """Roughness of one material."""

    id = "surface_roughness"
    slot = "contact"
    per_material = True
    parameters = (Parameter("roughness_m", "m", 2e-7, 3e-6, 1e-15, "s, height of the asperities"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(ContactTerm(ROUGHNESS, (self.values["roughness_m"],)))
