"""Invented: the gain breathes with a ripple on the supply, at any phase.

``V (1 + a sin(2 pi f t + phase))``, the phase free from shot to shot. Source: own; amplitude
modulation. Nothing on the line while nothing falls. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Breathing(Memoryless):
    def __init__(self, depth: float, frequency_hz: float, phase: float) -> None:
        self._depth, self._w, self._phase = depth, 2.0 * math.pi * frequency_hz, phase
        self._now_s = 0.0

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._now_s + step_s * np.arange(1, volts.size + 1)
        self._now_s += step_s * volts.size
        return np.asarray(volts * (1.0 + self._depth * np.sin(self._w * t + self._phase)))


class ModulatedGain(Effect):
    """A gain with a ripple."""

    id = "x_modulated_gain"
    slot = "electronics"
    order = 49
    parameters = (
        Parameter("depth", "1", 5e-4, 0.05, 0.0, "a"),
        Parameter("frequency_hz", "Hz", 50.0, 2e4, 1e3, "f of the ripple"),
    )

    def stage(self, shot: Shot) -> _Breathing | None:
        """Return the gain at this shot's phase."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        if self.values["depth"] == 0.0:
            return None
        return _Breathing(self.values["depth"], self.values["frequency_hz"], phase)
