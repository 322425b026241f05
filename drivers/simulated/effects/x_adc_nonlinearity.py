"""Invented: the converter's steps are uneven and some codes never come.

Codes move by ``a sin(2 pi code / period)`` (integral nonlinearity) and every 64th code is missing.
Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter


class AdcNonlinearity(Effect):
    """A converter with uneven steps."""

    id = "x_adc_nonlinearity"
    slot = "electronics"
    order = 90
    parameters = (
        Parameter("amplitude_codes", "1", 1.0, 150.0, 0.0, "a"),
        Parameter("period_codes", "1", 300.0, 6000.0, 2000.0, "of the error along the range"),
    )

    def conversion(self) -> NDArray[np.uint16] | None:
        """Return the converter's code for each ideal code."""
        amplitude = self.values["amplitude_codes"]
        if amplitude == 0.0:
            return None
        ideal = np.arange(65536)
        moved = ideal + amplitude * np.sin(2.0 * np.pi * ideal / self.values["period_codes"])
        codes: NDArray[np.uint16] = np.clip(np.rint(moved), 0, 65535).astype(np.uint16)
        codes[codes % 64 == 63] -= 1
        return codes
