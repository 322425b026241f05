"""Invented: a neighbouring wire picks up the slope of the signal and gives it back.

``V + c V'``, taken below 500 kHz as no circuit differentiates beyond. Source: own; stray
capacitance across a resistor. To first order the pulse is only earlier, so what is left grows
with the curvature. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage

END_HZ = 5e5


class Feedthrough(Effect):
    """A wire that differentiates."""

    id = "x_feedthrough"
    slot = "electronics"
    order = 47
    fine_grid = True
    parameters = (Parameter("lead_s", "s", 2e-7, 1.5e-5, 0.0, "c of the slope", either_sign=True),)

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the wire: ``1 + c w s/(s + w)``."""
        lead, w = self.values["lead_s"], 2.0 * math.pi * END_HZ
        if lead == 0.0:
            return None
        one = np.array([1.0])
        return StateSpaceStage(np.array([[-w]]), one, -lead * w * w * one, 1.0 + lead * w)
