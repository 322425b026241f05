"""Invented: the cell's seat works loose, hit by hit.

Stiffness below the crystal times ``1 - a (1 - exp(-n/n0))`` at the n-th release. Source: own; a
screw that settles. The ring's pitch falls in the course of the campaign, whatever falls on what.
Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class LooseningSeat(Effect):
    """A seat that works loose."""

    id = "x_loosening_seat"
    slot = "mounting"
    parameters = (
        Parameter("final_loss", "1", 2e-4, 0.02, 0.0, "a, of stiffness", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 60.0, 20.0, "n0"),
    )

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        mechanics.cell_stiffness_n_per_m *= 1.0 - self.values["final_loss"] * settled
