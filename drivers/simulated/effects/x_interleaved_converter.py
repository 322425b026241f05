"""Invented: two converters take turns, and do not quite agree on size and moment.

``V + (-1)^k (a V + s V')/2``, k the number of the sample; which of the two comes first is chance.
Source: time-interleaved converters (Black & Hodges 1980). Neighbouring samples differ in proportion
to the signal and to its slope: a zigzag at half the rate, and none at rest. Outside the library on
purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless

PERIOD_S = 1e-6


class _Turns(Memoryless):
    def __init__(self, mismatch: float, skew_s: float, first: int) -> None:
        self._mismatch, self._skew_s, self._count = mismatch, skew_s, first

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size < 2:
            return volts
        finer = max(round(PERIOD_S / step_s), 1)
        k = self._count + np.arange(volts.size) // finer
        self._count += volts.size // finer
        error = self._mismatch * volts + self._skew_s * np.gradient(volts, step_s)
        return np.asarray(volts + np.where(k % 2 == 0, 0.5, -0.5) * error)


class InterleavedConverter(Effect):
    """Two converters in one."""

    id = "x_interleaved_converter"
    slot = "electronics"
    order = 93
    parameters = (
        Parameter("mismatch", "1", 5e-4, 0.05, 0.0, "a, of the gains", either_sign=True),
        Parameter("skew_s", "s", 2e-9, 1e-7, 0.0, "s, of the moments", either_sign=True),
    )

    def stage(self, shot: Shot) -> _Turns | None:
        """Return the two; either of them takes the first sample."""
        v = self.values
        first = int(shot.rng.integers(2))
        if v["mismatch"] == 0.0 and v["skew_s"] == 0.0:
            return None
        return _Turns(v["mismatch"], v["skew_s"], first)
