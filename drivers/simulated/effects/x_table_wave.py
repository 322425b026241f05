"""Invented: the table bends under the cell and sends the blow back, its high notes first.

Adds ``r V * sum_j (-1)^j g_j``, g_j damped sines of f, 4 f, 9 f, ... with an integral of one over
the number of them: modes of a beam, whose sum is an echo that disperses. Source: own; frequencies
of a bar in bending (Rayleigh, Theory of Sound, ch. 8). Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage

MODES = 7
DAMPING_RATIO = 0.03


class TableWave(Effect):
    """A table that sends the blow back."""

    id = "x_table_wave"
    slot = "sensor"
    order = 8
    parameters = (
        Parameter("share", "1", 5e-4, 0.1, 0.0, "r", either_sign=True),
        Parameter("frequency_hz", "Hz", 300.0, 2000.0, 800.0, "f of the lowest mode"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the table."""
        if self.values["share"] == 0.0:
            return None
        system, enters = np.zeros((2 * MODES, 2 * MODES)), np.zeros(2 * MODES)
        leaves = np.zeros(2 * MODES)
        for j in range(MODES):
            w = 2.0 * math.pi * self.values["frequency_hz"] * (j + 1) ** 2
            at = slice(2 * j, 2 * j + 2)
            system[at, at] = [[0.0, 1.0], [-w * w, -2.0 * DAMPING_RATIO * w]]
            enters[2 * j + 1] = 1.0
            leaves[2 * j] = (-1) ** j * self.values["share"] * w * w / MODES
        return StateSpaceStage(system, enters, leaves, 1.0)
