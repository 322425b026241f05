"""Invented: an off-centre hit on the cell loads its crystal only in part.

Gain ``1 - a z^2`` with z a standard normal number of each shot: never more than a central hit
gives. Source: own, first term of any smooth sensitivity with its maximum in the middle. Outside
the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Gain(Memoryless):
    def __init__(self, gain: float) -> None:
        self._gain = gain

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return self._gain * volts


class OffCentre(Effect):
    """A cell whose gain depends on the place of the hit."""

    id = "x_off_centre"
    slot = "sensor"
    order = 15
    parameters = (Parameter("mean_loss", "1", 3e-4, 0.03, 0.0, "a, mean loss of gain"),)

    def stage(self, shot: Shot) -> _Gain:
        """Return this hit's gain."""
        return _Gain(1.0 - self.values["mean_loss"] * float(shot.rng.standard_normal()) ** 2)
