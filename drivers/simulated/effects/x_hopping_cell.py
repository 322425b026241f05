"""Invented: a cell that only stands on the table hops when it is hit, and thumps as it lands.

A bell of 0.2 ms and of ``r`` times the area J of each pulse, ``T J/J1`` after it, J1 = 0.1 mV s.
Source: own; the blow throws cell and table apart at a speed in proportion to the momentum, gravity
brings the cell back after twice that speed over g. Later and larger the harder the hit, and never
a second touch of the sphere. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot

AREA_V_S = 1e-4
THUMP_S = 2e-4
LEAST_PEAK_V = 1e-4


class _Hops:
    """Keeps its own time, and the landings that are still to come."""

    def __init__(self, share: float, hop_s: float) -> None:
        self._share, self._hop_s = share, hop_s
        self._now_s = 0.0
        self._landings: list[tuple[float, float]] = []  # begin and area of the pulse before

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size == 0:
            return volts
        t = self._now_s + step_s * np.arange(1, volts.size + 1)
        self._now_s = float(t[-1])
        peak = int(np.argmax(volts))
        area = step_s * float(np.sum(volts))
        if volts[peak] > LEAST_PEAK_V and area > 0.0:
            self._landings.append((float(t[peak]) + self._hop_s * area / AREA_V_S, area))
        result = volts.copy()
        for begins_s, pulse in self._landings:
            x = (t - begins_s) / THUMP_S
            bell = np.where((x > 0.0) & (x < 1.0), 1.0 - np.cos(2.0 * np.pi * x), 0.0)
            result += self._share * pulse / THUMP_S * bell
        return result

    def is_quiet(self, threshold_v: float) -> bool:
        return all(begins_s + THUMP_S < self._now_s for begins_s, _ in self._landings)


class HoppingCell(Effect):
    """A cell that is not screwed down."""

    id = "x_hopping_cell"
    slot = "mounting"
    order = 6
    parameters = (
        Parameter("share", "1", 3e-4, 0.1, 0.0, "r, of the pulse's area"),
        Parameter("hop_s", "s", 1e-4, 1.5e-3, 5e-4, "T, of a hop after 0.1 mV s"),
    )

    def stage(self, shot: Shot) -> _Hops | None:
        """Return the cell, standing."""
        share = self.values["share"]
        return None if share == 0.0 else _Hops(share, self.values["hop_s"])
