"""Invented: a coupler with two poles, whose undershoot swings back through zero.

High-pass ``s^2/(s^2 + 2 zeta w s + w^2)``. Source: own; an IEPE coupler before an AC-coupled input
and a transformer. The library has it under a name that the search for effects does not try.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage


class TwoPoleCoupler(Effect):
    """A coupler that swings."""

    id = "x_two_pole_coupler"
    slot = "electronics"
    order = 61
    parameters = (
        Parameter("frequency_hz", "Hz", 3.0, 500.0, 0.0, "w / 2 pi"),
        Parameter("damping_ratio", "1", 0.15, 0.85, 0.5, "zeta"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the high-pass."""
        w, zeta = 2.0 * math.pi * self.values["frequency_hz"], self.values["damping_ratio"]
        if w == 0.0:
            return None
        system = np.array([[0.0, 1.0], [-w * w, -2.0 * zeta * w]])
        leaves = np.array([-w * w, -2.0 * zeta * w])
        return StateSpaceStage(system, np.array([0.0, 1.0]), leaves, 1.0)
