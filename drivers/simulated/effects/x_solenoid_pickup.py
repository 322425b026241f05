"""Invented: the valve's solenoid rings when it lets go, and the cable picks that up.

``a exp(-t/tau) sin(2 pi f t)``, t from the release: the same in every shot at the same time after
the valve, so that a higher drop meets a later and weaker part of it. Source: own; flyback of a
coil into its snubber. There before the trigger, never in step with the impact. Outside the
library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class SolenoidPickup(Effect):
    """A valve that is heard on the line."""

    id = "x_solenoid_pickup"
    slot = "electronics"
    order = 82
    parameters = (
        Parameter("amplitude_v", "V", 5e-4, 0.1, 0.0, "a, at the release"),
        Parameter("frequency_hz", "Hz", 300.0, 3000.0, 800.0, "f"),
        Parameter("decay_s", "s", 0.02, 0.1, 0.05, "tau"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what is picked up."""
        if self.values["amplitude_v"] == 0.0:
            return None
        ring = np.sin(2.0 * math.pi * self.values["frequency_hz"] * t_s)
        return np.asarray(self.values["amplitude_v"] * np.exp(-t_s / self.values["decay_s"]) * ring)
