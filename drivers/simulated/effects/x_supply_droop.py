"""Invented: the amplifier's supply droops with the charge it has given, and its gain with it.

``V (1 - a q)``, ``q' = |V| - q/tau``. Source: own; a reservoir capacitor behind a resistor. Grows
through the pulse, is largest after it, and heals within milliseconds. Outside the library on
purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless
from drivers.simulated.recursion import run_on


class _Droop(Memoryless):
    def __init__(self, loss_per_v_s: float, recovery_s: float) -> None:
        self._loss, self._recovery_s, self._q = loss_per_v_s, recovery_s, 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        keep = math.exp(-step_s / self._recovery_s)
        q = run_on(step_s * np.abs(volts), keep, self._q)
        self._q = float(q[-1])
        return np.asarray(volts * (1.0 - self._loss * q))


class SupplyDroop(Effect):
    """A supply that is too weak."""

    id = "x_supply_droop"
    slot = "electronics"
    order = 48
    parameters = (
        Parameter("loss_per_v_s", "1/(V s)", 5.0, 500.0, 0.0, "a, loss of gain by charge given"),
        Parameter("recovery_s", "s", 2e-4, 5e-3, 1e-3, "tau of the supply"),
    )

    def stage(self, shot: Shot) -> _Droop:
        """Return the supply."""
        return _Droop(self.values["loss_per_v_s"], self.values["recovery_s"])
