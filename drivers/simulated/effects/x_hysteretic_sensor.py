"""Invented: the crystal's charge lags behind its load (Bouc-Wen hysteresis).

``V + h z``, ``z' = V' - |V'| z |z| / z0^2``: z follows V up to about ``z0`` and keeps it on
the way back. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


@njit(cache=True)
def _follow(volts, before, z, reach, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        change = volts[i] - before
        z += change - abs(change) * z * abs(z) / (reach * reach)
        before = volts[i]
        out[i] = z
    return z


class _BoucWen:
    def __init__(self, share: float, reach_v: float) -> None:
        self._share, self._reach_v = share, reach_v
        self._before_v, self._z = 0.0, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        z = np.zeros_like(volts)
        self._z = float(_follow(volts, self._before_v, self._z, self._reach_v, z))
        self._before_v = float(volts[-1])
        # What stays behind leaks away with the charge; the offset of rest is no signal.
        return np.asarray(volts + self._share * (z - np.linspace(0.0, self._z, z.size)))

    def is_quiet(self, threshold_v: float) -> bool:
        return True


class HystereticSensor(Effect):
    """A crystal with hysteresis."""

    id = "x_hysteretic_sensor"
    slot = "sensor"
    order = 12
    fine_grid = True
    parameters = (
        Parameter("share", "1", 0.0015, 0.2, 0.0, "h", either_sign=True),
        Parameter("reach_v", "V", 0.2, 3.0, 1.0, "z0"),
    )

    def stage(self, shot: Shot) -> _BoucWen:
        """Return the hysteresis."""
        return _BoucWen(self.values["share"], self.values["reach_v"])
