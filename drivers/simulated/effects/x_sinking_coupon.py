"""Invented: the tape flows, and the coupon sinks until hard blows set it down on the cell's rim.

``V - s (V - V_c)`` beyond ``V_c = V_0/(1 + n/n0)`` at the n-th release, joined over 2 % of V_c: the
rim carries a share of what comes on top. Source: own; a second path for the force behind a gap. A
kink at a height of the signal, which comes down drop by drop until smaller pulses meet it too.
Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless

JOINT = 0.02


class _Rim(Memoryless):
    def __init__(self, share: float, begins_v: float) -> None:
        self._share, self._begins_v = share, begins_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        joint_v = JOINT * self._begins_v
        beyond = joint_v * np.logaddexp(0.0, (volts - self._begins_v) / joint_v)
        return np.asarray(volts - self._share * beyond)


class SinkingCoupon(Effect):
    """A coupon that comes to rest on more than the crystal."""

    id = "x_sinking_coupon"
    slot = "mounting"
    order = 2
    per_material = True
    parameters = (
        Parameter("share", "1", 3e-3, 0.3, 0.0, "s, carried by the rim beyond the gap"),
        Parameter("begins_v", "V", 1.5, 5.0, 3.0, "V_0, signal that closes the gap at first"),
        Parameter("drops_to_halve", "1", 8.0, 60.0, 20.0, "n0"),
    )

    def stage(self, shot: Shot) -> _Rim | None:
        """Return the rim as it is at this shot."""
        v = self.values
        if v["share"] == 0.0:
            return None
        return _Rim(v["share"], v["begins_v"] / (1.0 + shot.number / v["drops_to_halve"]))
