"""Invented: the transfer loses a few samples, and the record closes the gap as if nothing was.

From a time on, drawn anew in each shot, everything comes too early by so many whole
microseconds. Source: own; a buffer that overruns. Outside the library on purpose.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import DelayLine

WINDOW_S = (2e-5, 1e-3)  # of the gap, after the touch


class _Gap:
    """Late by the gap until it comes: a record's start is free, only the step is seen."""

    def __init__(self, lost_s: float, at_s: float) -> None:
        self._lost_s, self._at_s = lost_s, at_s
        self._past = DelayLine(lost_s)

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        t = self._past.hear(volts, step_s)
        return self._past.at(t - np.where(t < self._at_s, self._lost_s, 0.0))

    def is_quiet(self, threshold_v: float) -> bool:
        return self._past.is_quiet(threshold_v)


class LostSamples(Effect):
    """A record with a gap."""

    id = "x_lost_samples"
    slot = "electronics"
    order = 92
    fine_grid = True
    parameters = (Parameter("lost_s", "s", 1e-6, 1.2e-5, 0.0, "length of the gap"),)

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a whole number of microseconds."""
        values = super().draw(rng)
        values["lost_s"] = round(values["lost_s"] * 1e6) * 1e-6
        return values

    def stage(self, shot: Shot) -> _Gap | None:
        """Return this shot's gap."""
        at_s = math.exp(shot.rng.uniform(math.log(WINDOW_S[0]), math.log(WINDOW_S[1])))
        return None if self.values["lost_s"] == 0.0 else _Gap(self.values["lost_s"], at_s)
