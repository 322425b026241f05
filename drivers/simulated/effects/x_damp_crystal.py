"""Invented: a damp film on the crystal's edge leaks, and the more the higher the voltage.

``y = V - q``, ``q' = b y^3/V1^2 - q/tau``, V1 = 1 V: charge creeps over and comes back later.
Source: own; conduction that grows with the field, as of dirty insulators. Large pulses lose at
their back and swing under zero for a while, small ones next to nothing: no time constant fits
both. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


@njit(cache=True)
def _leak(volts, q, leak, back, out):  # type: ignore[no-untyped-def]  # compiled
    for i in range(volts.size):
        y = volts[i] - q
        # the film passes at most what drives it, however coarse the step
        q += y * min(leak * y * y, 1.0) - back * q
        out[i] = volts[i] - q
    return q


class _Film:
    def __init__(self, leak_per_s: float, return_s: float) -> None:
        self._leak_per_s, self._return_s, self._q = leak_per_s, return_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        out = np.zeros_like(volts)
        leak, back = step_s * self._leak_per_s, step_s / self._return_s
        self._q = float(_leak(volts, self._q, leak, back, out))
        return out

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._q) < threshold_v


class DampCrystal(Effect):
    """A crystal whose edge leaks."""

    id = "x_damp_crystal"
    slot = "sensor"
    order = 22
    parameters = (
        Parameter("leak_per_s", "1/s", 0.3, 100.0, 0.0, "b, at 1 V"),
        Parameter("return_s", "s", 5e-4, 2e-2, 3e-3, "tau, until the charge is back"),
    )

    def stage(self, shot: Shot) -> _Film | None:
        """Return the film."""
        v = self.values
        return None if v["leak_per_s"] == 0.0 else _Film(v["leak_per_s"], v["return_s"])
