"""Invented: the valve's click sets the stand swinging, and the coupon comes to meet the sphere.

Impact speed ``v + a exp(-t/tau) sin(2 pi f t)``, t the time of the fall. Source: own; a heavy
table on soft feet, kicked at the release. The swing is met at a phase that the height decides:
too fast from here, too slow from there, every time again. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

GRAVITY_M_PER_S2 = 9.80665  # only says how long it falls
LEAST_FACTOR = 0.1


class RecoilingStand(Effect):
    """A stand that the valve sets swinging."""

    id = "x_recoiling_stand"
    slot = "release"
    parameters = (
        Parameter("speed_m_per_s", "m/s", 5e-4, 0.04, 0.0, "a, of the coupon", either_sign=True),
        Parameter("frequency_hz", "Hz", 4.0, 40.0, 10.0, "f of the swing"),
        Parameter("decay_s", "s", 0.05, 0.5, 0.2, "tau of the swing"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the speed by that of the coupon at the touch."""
        fall_s = math.sqrt(2.0 * shot.drop_height_m / GRAVITY_M_PER_S2)
        phase = 2.0 * math.pi * self.values["frequency_hz"] * fall_s
        swing = math.exp(-fall_s / self.values["decay_s"]) * math.sin(phase)
        upward = self.values["speed_m_per_s"] * swing
        shot.speed_factor *= max(1.0 + upward / (GRAVITY_M_PER_S2 * fall_s), LEAST_FACTOR)
