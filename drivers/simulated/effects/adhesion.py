"""Adhesion: pull-off ``3 pi gamma R`` (``jkr``) or ``4 pi gamma R`` (``dmt``), W = 2 gamma.

``jkr``: ``F = 4E*a^3/(3R) - sqrt(8 pi W E* a^3)``, ``delta = a^2/R - sqrt(2 pi W a/E*)``, solved in
every stage of the integrator; the neck snaps at ``-3 a_c^2/R``. Source: Johnson, Kendall & Roberts
1971; soft bodies, large radii. ``dmt``: ``F = K delta^(3/2) - 2 pi W R`` until the indentation
is back at zero. Source: Derjaguin, Muller & Toporov 1975; hard bodies, small radii. Where a contact
ends with its force, a pull beyond ``4 pi gamma R``, the dashpot's with it, parts the surfaces.
Tell-tale: jump into contact and tensile tail; invisible unless tacky (tested).
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
    forms = ("jkr", "dmt")
    parameters = (
        Parameter("surface_energy_j_per_m2", "J/m2", 0.3, 3.0, 0.0, "gamma of each face"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if self.values["surface_energy_j_per_m2"] == 0.0:
            return
        mechanics.law = kernel.DMT if self.form == "dmt" else kernel.JKR
        mechanics.law_value = 2.0 * self.values["surface_energy_j_per_m2"]
