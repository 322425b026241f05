"""A delayed copy: ``V(t) + r V(t - T)``, from a cable or a wave in the coupon.

Source: own. Tell-tale: delayed copy; a very short one looks like gain (tested).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine


class _Echo:
    def __init__(self, delay_s: float, ratio: float) -> None:
        self._delay_s, self._ratio = delay_s, ratio
        self._past = DelayLine(delay_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        return np.asarray(volts + self._ratio * self._past.at(t - self._delay_s))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v / abs(self._ratio))


class Echo(Effect):
    """One echo."""

    id = "echo"
    slot = "electronics"
    order = 40
    fine_grid = True
    parameters = (
        Parameter("delay_s", "s", 1e-6, 6e-5, 0.0, "T"),
        Parameter("ratio", "1", 2e-3, 0.12, 0.0, "r", either_sign=True),
    )

    def stage(self, shot: Shot) -> _Echo | None:
        """Return the delay line."""
        if self.values["ratio"] == 0.0:
            return None
        return _Echo(self.values["delay_s"], self.values["ratio"])
