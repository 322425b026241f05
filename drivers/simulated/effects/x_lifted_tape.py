"""Invented: the seat of the cell is softer in tension than in compression (a tape that lifts).

Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.impact import Mechanics


class LiftedTape(Effect):
    """A tape that lifts."""

    id = "x_lifted_tape"
    slot = "mounting"
    parameters = (
        Parameter(
            "tension_stiffness_ratio", "1", 0.3, 0.999, 1.0, "stiffness in tension over compression"
        ),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a ratio whose distance from one is even in the logarithm."""
        lost = math.exp(rng.uniform(math.log(1e-3), math.log(0.7)))
        return {"tension_stiffness_ratio": 1.0 - lost}

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies."""
        mechanics.tension_stiffness_ratio = self.values["tension_stiffness_ratio"]
