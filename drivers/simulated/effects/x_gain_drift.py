"""Invented: the amplifier warms up and its gain drifts from shot to shot.

Gain ``1 + a (1 - exp(-n/n0))`` at the n-th shot. The library has a straight drift only, which the
search for effects does not try.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Gain(Memoryless):
    def __init__(self, gain: float) -> None:
        self._gain = gain

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return self._gain * volts


class GainDrift(Effect):
    """A gain that drifts between shots."""

    id = "x_gain_drift"
    slot = "electronics"
    order = 45
    parameters = (
        Parameter("final_change", "1", 0.005, 0.15, 0.0, "a", either_sign=True),
        Parameter("shots_to_settle", "1", 5.0, 100.0, 20.0, "n0"),
    )

    def stage(self, shot: Shot) -> _Gain:
        """Return this shot's gain."""
        settled = -math.expm1(-shot.number / self.values["shots_to_settle"])
        return _Gain(1.0 + self.values["final_change"] * settled)
