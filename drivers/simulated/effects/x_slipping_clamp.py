"""Invented: the clamp that holds the tube slips down a little every so many drops, and stays.

Height ``h - s floor(n/N)`` at the n-th release. Source: own. Steps in the order of the drops, the
same number of metres at every height. Outside the library on purpose.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot

LEAST_HEIGHT_M = 1e-3


class SlippingClamp(Effect):
    """A tube that sinks in steps."""

    id = "x_slipping_clamp"
    slot = "release"
    parameters = (
        Parameter("step_m", "m", 3e-5, 1.2e-3, 0.0, "s, of one slip", either_sign=True),
        Parameter("drops_between", "1", 8.0, 30.0, 15.0, "N"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        slips = math.floor(shot.number / self.values["drops_between"])
        left = shot.drop_height_m - slips * self.values["step_m"]
        shot.drop_height_m = max(left, LEAST_HEIGHT_M)
