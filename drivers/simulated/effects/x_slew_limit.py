"""Invented: the amplifier's output cannot move faster than so many volts per second.

Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


@njit(cache=True)
def _chase(volts, level, most, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        level += min(max(volts[i] - level, -most), most)
        out[i] = level
    return level


class _Slew:
    def __init__(self, limit_v_per_s: float) -> None:
        self._limit, self._level_v = limit_v_per_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        self._level_v = float(_chase(volts, self._level_v, self._limit * step_s, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._level_v) < threshold_v


class SlewLimit(Effect):
    """An amplifier that cannot keep up."""

    id = "x_slew_limit"
    slot = "electronics"
    order = 55
    fine_grid = True
    parameters = (Parameter("limit_v_per_s", "V/s", 3e4, 5e5, math.inf, "fastest change"),)

    def stage(self, shot: Shot) -> _Slew | None:
        """Return the limiter."""
        limit = self.values["limit_v_per_s"]
        return None if math.isinf(limit) else _Slew(limit)
