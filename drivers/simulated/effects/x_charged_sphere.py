"""Invented: a rubbed sphere carries charge, and the cell's bare cap picks it up.

``a (1 + z/2) / (1 + u |t|/R)`` around the landing, u the impact speed and R = 4 mm, z a standard
normal number of each shot; a share of the charge stays on the coupon at the touch, so that the sign
turns within 20 us. Source: own; image charge on a plane, contact electrification. There before
the trigger, in step with the impact, never through the crystal. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot

GRAVITY_M_PER_S2 = 9.80665  # only says when it lands
RADIUS_M = 4e-3
TURNS_WITHIN_S = 2e-5


class ChargedSphere(Effect):
    """A charge that flies past."""

    id = "x_charged_sphere"
    slot = "electronics"
    order = 81
    parameters = (
        Parameter("amplitude_v", "V", 1e-3, 0.2, 0.0, "a, at the touch"),
        Parameter("left_share", "1", 0.1, 2.0, 0.5, "of the charge left at the touch"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what is picked up."""
        size = self.values["amplitude_v"] * (1.0 + 0.5 * float(shot.rng.standard_normal()))
        if size == 0.0:
            return None
        fall_s = math.sqrt(2.0 * shot.drop_height_m / GRAVITY_M_PER_S2)
        since = t_s - fall_s
        near = 1.0 / (1.0 + GRAVITY_M_PER_S2 * fall_s * np.abs(since) / RADIUS_M)
        left = 0.5 * (1.0 + np.tanh(since / TURNS_WITHIN_S))
        return np.asarray(size * near * (1.0 - self.values["left_share"] * left))
