"""Invented: the input transistor warms itself with each pulse, and its offset follows.

``V + b W``, ``W' = V^2 - W/tau``: the output moves with the heat, whatever the sign of the signal.
Source: own; heat that couples back to the input (Solomon 1974). A slow tail after the pulse in
proportion to its energy, hence with the square of the pulse. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.recursion import run_on


class _Heat:
    def __init__(self, offset: float, cooling_s: float) -> None:
        self._offset, self._cooling_s, self._warmth = offset, cooling_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        keep = math.exp(-step_s / self._cooling_s)
        warmth = run_on(step_s * volts * volts, keep, self._warmth)
        self._warmth = float(warmth[-1])
        return np.asarray(volts + self._offset * warmth)

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._offset * self._warmth) < threshold_v


class ThermalTail(Effect):
    """An amplifier that warms itself."""

    id = "x_thermal_tail"
    slot = "electronics"
    order = 46
    parameters = (
        Parameter("offset_per_v_s", "1/(V s)", 0.4, 120.0, 0.0, "b", either_sign=True),
        Parameter("cooling_s", "s", 3e-4, 1e-2, 2e-3, "tau"),
    )

    def stage(self, shot: Shot) -> _Heat | None:
        """Return the transistor, cold."""
        v = self.values
        return None if v["offset_per_v_s"] == 0.0 else _Heat(v["offset_per_v_s"], v["cooling_s"])
