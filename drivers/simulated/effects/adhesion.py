"""Adhesion after Johnson, Kendall & Roberts: pull-off ``3 pi gamma R``, W = 2 gamma.

``F = 4E*a^3/(3R) - sqrt(8 pi W E* a^3)``, ``delta = a^2/R - sqrt(2 pi W a/E*)``, solved in every
stage of the integrator; the neck snaps at ``-3 a_c^2/R``. Source: JKR 1971; soft bodies, large
radii. Tell-tale: jump into contact and tensile tail; invisible unless tacky (tested).
"""

from __future__ import annotations

from drivers.simulated import impact_kernel as kernel
from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class Adhesion(Effect):
    """Adhesion of one material."""

    id = "adhesion"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("surface_energy_j_per_m2", "J/m2", 0.3, 3.0, 0.0, "gamma of each face"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if self.values["surface_energy_j_per_m2"] == 0.0:
            return
        mechanics.law = kernel.JKR
        mechanics.law_value = 2.0 * self.values["surface_energy_j_per_m2"]
