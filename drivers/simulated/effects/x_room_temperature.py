"""Invented: the room warms and cools while the drops go on, and the crystal with it.

Gain ``1 + a s`` and crystal stiffness times ``1 - 0.15 a s``, ``s = sin(2 pi n/N)`` at the n-th
release. Source: own; lead zirconate titanate gains some 0.2 % of charge and softens by some 0.03 %
in a kelvin. A drift that comes back. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless
from drivers.simulated.impact import Mechanics

SOFTENING = 0.15


class _Gain(Memoryless):
    def __init__(self, gain: float) -> None:
        self._gain = gain

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return self._gain * volts


class RoomTemperature(Effect):
    """A crystal that follows the room."""

    id = "x_room_temperature"
    slot = "sensor"
    order = 16
    parameters = (
        Parameter("change", "1", 5e-4, 0.04, 0.0, "a, of the gain", either_sign=True),
        Parameter("drops_a_turn", "1", 12.0, 60.0, 30.0, "N"),
    )

    def _now(self, shot: Shot) -> float:
        turns = shot.number / self.values["drops_a_turn"]
        return self.values["change"] * math.sin(2.0 * math.pi * turns)

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the crystal's stiffness."""
        mechanics.cell_stiffness_n_per_m *= 1.0 - SOFTENING * self._now(shot)

    def stage(self, shot: Shot) -> _Gain:
        """Return this shot's gain."""
        return _Gain(1.0 + self._now(shot))
