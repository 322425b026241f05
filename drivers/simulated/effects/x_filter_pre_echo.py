"""Invented: the converter's digital filter is symmetric in time and rings before the signal.

``V(t) + r (V(t - T) + V(t + T))``: a ripple of the pass band. The record's start is free,
so all of it comes later by T. Source: paired echoes (Wheeler 1939). A copy comes before what
it copies. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class _PairedEcho:
    def __init__(self, ratio: float, spacing_s: float) -> None:
        self._ratio, self._spacing_s = ratio, spacing_s
        self._t, self._v = np.zeros(1), np.zeros(1)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        t = self._t[-1] + step_s * np.arange(1, volts.size + 1)
        past_t, past_v = np.concatenate((self._t, t)), np.concatenate((self._v, volts))
        keep = past_t >= t[-1] - 2.0 * self._spacing_s - 2e-6
        self._t, self._v = past_t[keep], past_v[keep]
        middle, late = (
            np.interp(t - n * self._spacing_s, past_t, past_v, left=0.0) for n in (1, 2)
        )
        return np.asarray(middle + self._ratio * (volts + late))

    def is_quiet(self, threshold_v: float) -> bool:
        return bool(np.all(np.abs(self._v) < threshold_v))


class FilterPreEcho(Effect):
    """A filter that knows what is to come."""

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
