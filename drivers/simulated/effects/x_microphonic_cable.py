"""Invented: the valve's jolt makes the cable swing, and a swinging cable makes a voltage.

``a z exp(-t/tau) sin(2 pi f t + phase)``, t from the release, z (standard normal) and the phase
free from shot to shot. Source: own; triboelectric noise of coaxial cables (Perls 1952 measured
it). There before the trigger, at a frequency that has nothing to do with the mains. Outside the
library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class MicrophonicCable(Effect):
    """A cable that makes a voltage when it swings."""

    id = "x_microphonic_cable"
    slot = "electronics"
    order = 83
    parameters = (
        Parameter("amplitude_v", "V", 4e-4, 0.05, 0.0, "a, at the release"),
        Parameter("frequency_hz", "Hz", 400.0, 6000.0, 1500.0, "f of the swing"),
        Parameter("decay_s", "s", 0.03, 0.2, 0.1, "tau"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the voltage of this shot's swing."""
        phase = float(shot.rng.uniform(0.0, 2.0 * math.pi))
        size = self.values["amplitude_v"] * float(shot.rng.standard_normal())
        if size == 0.0:
            return None
        ring = np.sin(2.0 * math.pi * self.values["frequency_hz"] * t_s + phase)
        return np.asarray(size * np.exp(-t_s / self.values["decay_s"]) * ring)
