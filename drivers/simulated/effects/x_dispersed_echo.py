"""Invented: a wave comes back from the cell's far end, turned over and smeared on its way.

``V - r (V late by T) through two poles at f``. Source: own; reflection at a free end, losses that
grow with the pitch. No copy of the signal: an area without its edges. Outside the library on
purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine, StateSpaceStage
from drivers.simulated.filters import resonance

DAMPING_RATIO = 0.9


class _Echo:
    def __init__(self, ratio: float, delay_s: float, smear: StateSpaceStage) -> None:
        self._ratio, self._delay_s, self._smear = ratio, delay_s, smear
        self._past = DelayLine(delay_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        late = self._past.at(self._past.hear(volts, step_s) - self._delay_s)
        return np.asarray(volts - self._ratio * self._smear.process(late, step_s))

    def is_quiet(self, threshold_v: float) -> bool:
        silent = self._past.is_quiet(threshold_v / abs(self._ratio))
        return silent and self._smear.is_quiet(threshold_v)


class DispersedEcho(Effect):
    """An echo that is no copy."""

    id = "x_dispersed_echo"
    slot = "sensor"
    order = 9
    fine_grid = True
    parameters = (
        Parameter("ratio", "1", 1.5e-3, 0.15, 0.0, "r"),
        Parameter("delay_s", "s", 1e-5, 2e-4, 5e-5, "T"),
        Parameter("smear_hz", "Hz", 1.5e3, 1.5e4, 5e3, "f of the two poles"),
    )

    def stage(self, shot: Shot) -> _Echo | None:
        """Return the wave."""
        v = self.values
        if v["ratio"] == 0.0:
            return None
        return _Echo(v["ratio"], v["delay_s"], resonance(v["smear_hz"], DAMPING_RATIO, 1.0, 0.0))
