"""The amplifier's output ends at ``V_c``, abruptly or softly.

``rapp``: ``V / (1 + |V/V_c|^(1/s))^s`` (Rapp 1991), for softness 0 ``min(|V|, V_c)``. ``tanh``:
``V_c tanh(V/V_c)``, the differential pair of any textbook, soft all along; softness says nothing.
Tell-tale: flat tops (tested).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Limiter(Memoryless):
    def __init__(self, limit_v: float, softness: float) -> None:
        self._limit_v, self._softness = limit_v, softness

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if self._softness == 0.0:
            return np.clip(volts, -self._limit_v, self._limit_v)
        ratio = np.abs(volts / self._limit_v) ** (1.0 / self._softness)
        return np.asarray(volts / (1.0 + ratio) ** self._softness)


class _TanhLimiter(Memoryless):
    def __init__(self, limit_v: float) -> None:
        self._limit_v = limit_v

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        return self._limit_v * np.tanh(volts / self._limit_v)


class Clipping(Effect):
    """An amplifier at its limit."""

    id = "clipping"
    slot = "electronics"
    order = 70
    forms = ("rapp", "tanh")
    parameters = (
        Parameter("limit_v", "V", 0.8, 8.5, math.inf, "V_c"),
        Parameter("softness", "1", 0.02, 0.3, 0.0, "s, 0 for an abrupt end"),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a random limit, abrupt in one case of two."""
        values = super().draw(rng)
        if rng.random() < 0.5:
            values["softness"] = 0.0
        return values

    def stage(self, shot: Shot) -> _Limiter | _TanhLimiter | None:
        """Return the limiter."""
        if math.isinf(self.values["limit_v"]):
            return None
        if self.form == "tanh":
            return _TanhLimiter(self.values["limit_v"])
        return _Limiter(self.values["limit_v"], self.values["softness"])
