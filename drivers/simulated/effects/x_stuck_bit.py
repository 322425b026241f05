"""Invented: one bit of the converter is always set.

Codes of every second stretch of ``2^b`` are lifted by ``2^b``. Source: own; a bad joint on
a data line. Locked to the level of the signal, at rest and in the pulse. Outside the library on
purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter


class StuckBit(Effect):
    """A converter with a stuck bit."""

    id = "x_stuck_bit"
    slot = "electronics"
    order = 91
    parameters = (Parameter("bit", "1", 3.0, 9.0, -1.0, "b, counted from the lowest"),)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a bit, each as likely as any other."""
        return {"bit": float(rng.integers(3, 10))}

    def conversion(self) -> NDArray[np.uint16] | None:
        """Return the converter's code for each ideal code."""
        bit = round(self.values["bit"])
        if bit < 0:
            return None
        return np.arange(65536, dtype=np.uint16) | np.uint16(1 << bit)
