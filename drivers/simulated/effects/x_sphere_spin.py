"""Invented: an oblique hit spins the sphere; friction excites a slow decaying sideways mode.

Adds ``r V * g`` with g a damped sine of a few hundred hertz: its size follows the impulse and
differs from shot to shot. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage


class SphereSpin(Effect):
    """A slow mode of friction."""

    id = "x_sphere_spin"
    slot = "contact"
    order = 5
    per_material = True
    parameters = (
        Parameter("share", "1", 5e-4, 0.2, 0.0, "r, per one radian of the mode"),
        Parameter("frequency_hz", "Hz", 300.0, 2500.0, 800.0, "of the mode"),
        Parameter("decay_s", "s", 3e-4, 3e-3, 1e-3, "of the mode"),
    )

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the mode, as strong as this hit was oblique."""
        oblique = float(abs(shot.rng.standard_normal()))
        if self.values["share"] == 0.0:
            return None
        w, a = 2.0 * math.pi * self.values["frequency_hz"], 1.0 / self.values["decay_s"]
        system = np.array([[0.0, 1.0], [-(w * w + a * a), -2.0 * a]])
        gain = self.values["share"] * oblique * w * w
        return StateSpaceStage(system, np.array([0.0, 1.0]), np.array([gain, 0.0]), 1.0)
