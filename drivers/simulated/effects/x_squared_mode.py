"""Invented: the crystal bulges as it is pressed, and the bulge rings on its own.

``V + r g * V^2/V1``, V1 = 1 V, g a damped sine of frequency ``f`` and area one. Source: own;
a sideways mode that the square of the compression drives, as geometry does at second order (Nayfeh
& Mook 1979). A line beside the ring that grows with the square of the pulse, and is not
there in low drops. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.filters import resonance

DAMPING_RATIO = 0.01


class _Bulge:
    def __init__(self, share: float, frequency_hz: float) -> None:
        self._mode = resonance(frequency_hz, DAMPING_RATIO, share, 0.0)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(volts + self._mode.process(volts * volts, step_s))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._mode.is_quiet(threshold_v)


class SquaredMode(Effect):
    """A mode that is driven at second order."""

    id = "x_squared_mode"
    slot = "sensor"
    order = 11
    parameters = (
        Parameter("share", "1", 3e-5, 0.01, 0.0, "r, at a signal of 1 V", either_sign=True),
        Parameter("frequency_hz", "Hz", 4e3, 2.5e4, 1e4, "f"),
    )

    def stage(self, shot: Shot) -> _Bulge | None:
        """Return the mode, at rest."""
        share = self.values["share"]
        return None if share == 0.0 else _Bulge(share, self.values["frequency_hz"])
