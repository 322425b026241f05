"""Invented: the crystal gives another charge for pull than for push.

``V`` where it is positive, ``(1 + a) V`` where it is negative. Source: own; a stack whose
preload is too small reads tension through its bolt alone. A kink at zero. Outside the library on
purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _TwoGains(Memoryless):
    def __init__(self, change: float) -> None:
        self._change = change

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return np.asarray(np.where(volts < 0.0, (1.0 + self._change) * volts, volts))


class PushPullGain(Effect):
    """Two gains."""

    id = "x_push_pull_gain"
    slot = "sensor"
    order = 13
    parameters = (
        Parameter("change", "1", 1e-3, 0.15, 0.0, "a, of the gain in pull", either_sign=True),
    )

    def stage(self, shot: Shot) -> _TwoGains | None:
        """Return the two gains."""
        change = self.values["change"]
        return None if change == 0.0 else _TwoGains(change)
