"""Invented: the sensor says less than it should near zero (crossover distortion).

``V - w tanh(V/w)``: a signal well above ``w`` loses w, the end of the ring vanishes. Source: own,
smooth form of the dead zone of a class-B stage (Horowitz & Hill 2015, 2.4) or of a stack with a
gap. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _DeadZone(Memoryless):
    def __init__(self, width_v: float) -> None:
        self._width_v = width_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(volts - self._width_v * np.tanh(volts / self._width_v))


class DeadZone(Effect):
    """A sensor with a dead zone."""

    id = "x_dead_zone"
    slot = "sensor"
    order = 14
    parameters = (Parameter("width_v", "V", 3e-4, 0.1, 0.0, "w, what is lost"),)

    def stage(self, shot: Shot) -> _DeadZone | None:
        """Return the dead zone."""
        width = self.values["width_v"]
        return None if width == 0.0 else _DeadZone(width)
