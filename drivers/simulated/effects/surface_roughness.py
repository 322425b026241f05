"""Asperities soften the first touch.

``toe``: force times ``1 - exp(-delta/s)``, Hertz from the plane of the first touch once the
asperities are flat. Source: own form. Greenwood & Tripp 1967, whose bulk is met some heights below
that plane, is another law, and its opposite in sign: against the Hertz curve of the heavy loads it
presses more at first, this form less. Not validated against measured roughness.

``series``: ``delta = (F/K)^(2/3) + s ln(1 + F/F0)``, a flat layer of asperities with exponential
heights on top of the bulk. Source: Greenwood & Williamson 1966; Persson 2007.

Tell-tale: soft toe, worse at low speed (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import ASPERITIES, ROUGHNESS

ASPERITY_FORCE_N = 0.3
"""F0. A choice: contacts here peak at 6 to 42 N (1.1 to 8.5 V of a cell of 5 N/V), so that a layer
gives way by 3 to 5 of its s, most of it before half of the peak."""


class SurfaceRoughness(Effect):
    """Roughness of one material."""

    id = "surface_roughness"
    slot = "contact"
    per_material = True
    forms = ("toe", "series")
    parameters = (Parameter("roughness_m", "m", 2e-7, 3e-6, 1e-15, "s, height of the asperities"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        height = self.values["roughness_m"]
        term = ContactTerm(ROUGHNESS, (height,))
        if self.form == "series":
            term = ContactTerm(ASPERITIES, (height, ASPERITY_FORCE_N))
        mechanics.terms.append(term)
