"""Invented: the sphere lands obliquely and slides at first; the cell feels the shear.

``V (1 + q s(t))``: s is one while the sphere slides and falls to zero when its share of the
impulse has been delivered, some shots earlier, some later. Source: own; sliding of a solid sphere
ends at the impulse ``2 m v_t / (7 mu)`` (Maw, Barber & Fawcett 1976), and a cell has a cross
sensitivity. A step in the pulse, none in the ring. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless

SCATTER = 0.3  # of the share of the impulse, from shot to shot
JOINT = 0.02  # share of the impulse over which sliding ends


class _Shear(Memoryless):
    def __init__(self, cross: float, slides_until: float) -> None:
        self._cross, self._until = cross, slides_until

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        delivered = np.cumsum(volts)
        most = float(np.max(delivered, initial=0.0))
        if most == 0.0:
            return volts
        sliding = expit((self._until - np.maximum.accumulate(delivered) / most) / JOINT)
        return np.asarray(volts * (1.0 + self._cross * sliding))


class ObliqueFriction(Effect):
    """A hit that slides before it sticks."""

    id = "x_oblique_friction"
    slot = "contact"
    order = 4
    per_material = True
    parameters = (
        Parameter(
            "cross_share", "1", 1e-3, 0.05, 0.0, "q, shear felt over force", either_sign=True
        ),
        Parameter("slides_until", "1", 0.2, 0.8, 0.5, "share of the impulse when sliding ends"),
    )

    def stage(self, shot: Shot) -> _Shear | None:
        """Return the shear of this hit."""
        scatter = math.exp(SCATTER * float(shot.rng.standard_normal()))
        if self.values["cross_share"] == 0.0:
            return None
        return _Shear(self.values["cross_share"], self.values["slides_until"] * scatter)
