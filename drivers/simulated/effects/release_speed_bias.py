"""The sphere falls from another height than the scale says (suction, the tube's edge).

Source: own. Tell-tale: amplitude against height is off, most at low drops (tested).
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class ReleaseSpeedBias(Effect):
    """A wrong zero of the height scale."""

    id = "release_speed_bias"
    slot = "release"
    parameters = (
        Parameter(
            "height_offset_m",
            "m",
            1e-4,
            3e-3,
            0.0,
            "true height less the stated one",
            either_sign=True,
        ),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        shot.drop_height_m = max(shot.drop_height_m + self.values["height_offset_m"], 1e-4)
