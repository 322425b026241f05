"""Invented: the seal sometimes holds on to the sphere by one edge before it lets go altogether.

In a share of the drops the sphere falls a fixed distance less, in all others the whole way.
Source: own; a lip of rubber that sticks or does not. Two kinds of drops and nothing between them.
Outside the library on purpose.
"""

from __future__ import annotations

from drivers.simulated.effects.effect import Effect, Parameter, Shot

LEAST_HEIGHT_M = 1e-4


class StickySeal(Effect):
    """A release in two stages, now and then."""

    id = "x_sticky_seal"
    slot = "release"
    parameters = (
        Parameter("lost_m", "m", 1e-4, 4e-3, 0.0, "height lost when it sticks"),
        Parameter("share", "1", 0.1, 0.5, 0.3, "of the drops in which it sticks"),
    )

    def at_release(self, shot: Shot) -> None:
        """Change the fall of the drops that stick."""
        if shot.rng.random() < self.values["share"]:
            left = shot.drop_height_m - self.values["lost_m"]
            shot.drop_height_m = max(left, LEAST_HEIGHT_M)
