"""Invented: the amplifier changes its range within the pulse, and the two do not quite agree.

Above a threshold the gain is ``1 + a`` times what it was, back below half of it. Source:
own; a switched divider with a wrong resistor. Steps in the trace, and at two heights. Outside the
library on purpose.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


@njit(cache=True)
def _switch(volts, upper, threshold, gain, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        size = abs(volts[i])
        upper = size > threshold or (upper and size > 0.5 * threshold)
        out[i] = volts[i] * (gain if upper else 1.0)
    return upper


class _TwoRanges:
    def __init__(self, change: float, threshold_v: float) -> None:
        self._gain, self._threshold_v, self._upper = 1.0 + change, threshold_v, False

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        self._upper = bool(_switch(volts, self._upper, self._threshold_v, self._gain, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return True


class AutoRange(Effect):
    """An amplifier with two ranges."""

    id = "x_auto_range"
    slot = "electronics"
    order = 65
    parameters = (
        Parameter("change", "1", 1e-3, 0.1, 0.0, "a", either_sign=True),
        Parameter("threshold_v", "V", 0.3, 4.0, 1.0, "of the upper range"),
    )

    def stage(self, shot: Shot) -> _TwoRanges | None:
        """Return the amplifier."""
        v = self.values
        return None if v["change"] == 0.0 else _TwoRanges(v["change"], v["threshold_v"])
