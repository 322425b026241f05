"""The crystal's charge is not quite proportional: ``V + b V^2``.

Source: own, first term of any smooth curve. Tell-tale: misfit only at the peak (tested).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Quadratic(Memoryless):
    def __init__(self, curvature_per_v: float) -> None:
        self._b = curvature_per_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return volts + self._b * volts * volts


class SensorNonlinearity(Effect):
    """A curved characteristic."""

    id = "sensor_nonlinearity"
    slot = "sensor"
    order = 10
    parameters = (Parameter("curvature_per_v", "1/V", 3e-4, 3e-2, 0.0, "b", either_sign=True),)

    def stage(self, shot: Shot) -> _Quadratic:
        """Return the characteristic."""
        return _Quadratic(self.values["curvature_per_v"])
