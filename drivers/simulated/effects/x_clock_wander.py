"""Invented: the converter's clock wanders, so that samples are not evenly spaced.

``V(t - A (1 + sin(2 pi f t + phase)))``, the phase free from shot to shot; the mean delay is only
a later touch. Source: own; phase noise of an oscillator on an unquiet supply. Largest where the
signal is steepest. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine


class _Wander:
    def __init__(self, amplitude_s: float, frequency_hz: float, phase: float) -> None:
        self._amplitude_s, self._w, self._phase = amplitude_s, 2.0 * math.pi * frequency_hz, phase
        self._past = DelayLine(2.0 * amplitude_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        return self._past.at(t - self._amplitude_s * (1.0 + np.sin(self._w * t + self._phase)))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class ClockWander(Effect):
    """A clock that wanders."""

    id = "x_clock_wander"
    slot = "electronics"
    order = 85
    fine_grid = True
    parameters = (
        Parameter("amplitude_s", "s", 3e-9, 1e-6, 0.0, "A"),
        Parameter("frequency_hz", "Hz", 1e3, 3e4, 5e3, "f of the wander"),
    )

    def stage(self, shot: Shot) -> _Wander | None:
        """Return the clock at this shot's phase."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        if self.values["amplitude_s"] == 0.0:
            return None
        return _Wander(self.values["amplitude_s"], self.values["frequency_hz"], phase)
