"""Invented: a sphere with a void inside, which turns away when its centre of mass is not above.

Mass at the point of contact ``m / (1 + 5/2 e^2 sin^2(theta))``, e the offset of the centre of mass
over R, theta its angle to the vertical, any direction as likely as any other in each shot. Source:
textbook impact of a smooth body, ``1/m + l^2/I``; I of a solid sphere. Shorter and weaker pulses by
chance, never longer ones, and the stiffness stays. Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics

INERTIA = 0.4  # I/(m R^2)


class EccentricSphere(Effect):
    """A sphere whose mass is not centred."""

    id = "x_eccentric_sphere"
    slot = "contact"
    per_material = True
    parameters = (Parameter("offset", "1", 0.03, 0.35, 0.0, "e, of the centre of mass, over R"),)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the mass that the contact feels."""
        cosine = float(shot.rng.uniform(-1.0, 1.0))
        lever = self.values["offset"] ** 2 * (1.0 - cosine**2)
        mechanics.sphere_mass_kg /= 1.0 + lever / INERTIA
