"""The crystal moves: the Kelvin-Voigt element of Eqs 8-11, as an effect on a rigid (HSD) cell.

The crystal's mass follows from the cell's stiffness: ``M = k/omega0^2``.
Source: the paper, Eqs 8-11. Tell-tale: delay, asymmetry, ring after the pulse (tested).
Refused on a cell that already moves.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class CrystalDynamics(Effect):
    """The step from HSD to KV."""

    id = "crystal_dynamics"
    slot = "sensor"
    parameters = (
        Parameter("natural_frequency_hz", "Hz", 1.2e4, 6e4, math.inf, "omega0 / 2 pi"),
        Parameter("damping_ratio", "1", 0.03, 0.3, 0.07, "zeta"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        if math.isinf(self.values["natural_frequency_hz"]):
            return
        if not mechanics.rigid:
            raise ValueError(
                "crystal_dynamics is the step from a rigid cell to a moving one; this cell "
                'moves already. Choose cell_model = "hsd".'
            )
        w0 = 2.0 * math.pi * self.values["natural_frequency_hz"]
        k = mechanics.cell_stiffness_n_per_m
        mechanics.rigid = False
        mechanics.cell_mass_kg = k / (w0 * w0)
        mechanics.cell_damping_n_s_per_m = 2.0 * self.values["damping_ratio"] * k / w0
