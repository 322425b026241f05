"""Invented: sphere and coupon part with charge, as much as they had touched.

``V + a A``, A grows with the greatest area of contact so far, ``(V/1 V)^(2/3)`` after Hertz, and
leaks away in ``tau``. Source: own; contact electrification in proportion to the area (Lowell
& Rose-Innes 1980), seen by the cell's unshielded cap. Rises with the pulse to its peak, stays when
the sphere has gone, and falls behind the force as drops get higher. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.recursion import run_on


class _Charge:
    def __init__(self, amplitude_v: float, leak_s: float) -> None:
        self._amplitude_v, self._leak_s, self._area = amplitude_v, leak_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        widest = np.maximum.accumulate(np.maximum(volts, 0.0)) ** (2.0 / 3.0)
        grown = np.diff(widest, prepend=0.0)
        area = run_on(grown, math.exp(-step_s / self._leak_s), self._area)
        self._area = float(area[-1])
        return np.asarray(volts + self._amplitude_v * area)

    def is_quiet(self, threshold_v: float) -> bool:
        return abs(self._amplitude_v * self._area) < threshold_v


class ContactCharge(Effect):
    """Charge that a touch leaves behind."""

    id = "x_contact_charge"
    slot = "electronics"
    order = 3
    per_material = True
    parameters = (
        Parameter("amplitude_v", "V", 3e-4, 0.08, 0.0, "a, at a signal of 1 V", either_sign=True),
        Parameter("leak_s", "s", 2e-4, 2e-2, 2e-3, "tau"),
    )

    def stage(self, shot: Shot) -> _Charge | None:
        """Return the charge of this hit."""
        v = self.values
        return None if v["amplitude_v"] == 0.0 else _Charge(v["amplitude_v"], v["leak_s"])
