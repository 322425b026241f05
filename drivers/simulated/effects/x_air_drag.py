"""Invented: air that is drawn up into the tube brakes the fall.

``v^2 = (g/b)(1 - exp(-2 b h))``: drag that grows with the square of the speed, from rest. Source:
any textbook of mechanics; in still air b is 0.01 per metre for these spheres, a draught adds to it.
A loss of speed that grows with the height. Outside the library on purpose: a law that wrong
heights are held against, never a name.
"""

from __future__ import annotations

import math

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class AirDrag(Effect):
    """A fall through moving air."""

    id = "x_air_drag"
    slot = "release"
    parameters = (Parameter("drag_per_m", "1/m", 0.05, 4.0, 0.0, "b"),)

    def at_release(self, shot: Shot) -> None:
        """Change the fall."""
        x = 2.0 * self.values["drag_per_m"] * shot.drop_height_m
        if x > 0.0:
            shot.speed_factor *= math.sqrt(-math.expm1(-x) / x)
