"""Invented: the converter's digital filter is symmetric in time and rings before the signal.

``V(t) + r (V(t - T) + V(t + T))``: a ripple of the pass band. The record's start is free,
so all of it comes later by T. Source: paired echoes (Wheeler 1939). A copy comes before what
it copies. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine


class _PairedEcho:
    def __init__(self, ratio: float, spacing_s: float) -> None:
        self._ratio, self._spacing_s = ratio, spacing_s
        self._past = DelayLine(2.0 * spacing_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        middle, late = (self._past.at(t - n * self._spacing_s) for n in (1, 2))
        return np.asarray(middle + self._ratio * (volts + late))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class FilterPreEcho(Effect):
    """A filter that rings before the signal."""

    id = "x_filter_pre_echo"
    slot = "electronics"
    order = 87
    fine_grid = True
    parameters = (
        Parameter("ratio", "1", 5e-4, 0.05, 0.0, "r", either_sign=True),
        Parameter("spacing_s", "s", 5e-6, 5e-5, 2e-5, "T"),
    )

    def stage(self, shot: Shot) -> _PairedEcho | None:
        """Return the filter."""
        v = self.values
        return None if v["ratio"] == 0.0 else _PairedEcho(v["ratio"], v["spacing_s"])
