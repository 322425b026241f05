"""Invented: a viscous film squeezed out between the bodies, ``c exp(-delta/h) delta'``.

Loads the crystal as well; on the way back it pulls with a tenth of the strength (cavitation).
Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import ContactTerm, Mechanics
from drivers.simulated.impact_kernel import FILM


class LubricationFilm(Effect):
    """A film between the bodies."""

    id = "x_lubrication_film"
    slot = "contact"
    per_material = True
    parameters = (
        Parameter("damping_n_s_per_m", "N s/m", 0.03, 10.0, 0.0, "c at touch"),
        Parameter("depth_m", "m", 2e-6, 3e-5, 1e-5, "h, indentation that squeezes the film out"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Add the term to the force of contact."""
        mechanics.terms.append(
            ContactTerm(FILM, (self.values["damping_n_s_per_m"], self.values["depth_m"], 0.1))
        )
