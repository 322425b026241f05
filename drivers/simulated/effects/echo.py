"""A delayed copy: ``V(t) + r V(t - T)``, from a cable or a wave in the coupon.

Source: own. Tell-tale: delayed copy; a very short one looks like gain (tested).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class _Delay:
    def __init__(self, delay_s: float, ratio: float) -> None:
        self._delay_s, self._ratio = delay_s, ratio
        self._t = np.zeros(0)
        self._v = np.zeros(0)
        self._now_s = 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._now_s + step_s * np.arange(1, volts.size + 1)
        self._now_s = float(t[-1]) if t.size else self._now_s
        past_t = np.concatenate((self._t, t))
        past_v = np.concatenate((self._v, volts))
        late = np.interp(t - self._delay_s, past_t, past_v, left=0.0)
        keep = past_t >= self._now_s - self._delay_s - 2e-6
        self._t, self._v = past_t[keep], past_v[keep]
        return np.asarray(volts + self._ratio * late)

    def is_quiet(self, threshold_v: float) -> bool:
        return bool(np.all(np.abs(self._ratio * self._v) < threshold_v))


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

    def stage(self, shot: Shot) -> _Delay | None:
        """Return the delay line."""
        if self.values["ratio"] == 0.0:
            return None
        return _Delay(self.values["delay_s"], self.values["ratio"])
