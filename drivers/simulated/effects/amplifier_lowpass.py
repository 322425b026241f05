"""Low-pass of the amplifier, first order or second order (Butterworth).

Source: textbook. Tell-tale: delay, lower ring (tested).
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import StateSpaceStage, lowpass_first, resonance


class AmplifierLowpass(Effect):
    """A slow amplifier."""

    id = "amplifier_lowpass"
    slot = "electronics"
    order = 50
    fine_grid = True
    parameters = (
        Parameter("cutoff_hz", "Hz", 1e4, 5e5, math.inf, "-3 dB frequency"),
        Parameter("filter_order", "1", 1.0, 2.0, 1.0, "1 or 2"),
    )

    def __post_init__(self) -> None:
        """Refuse orders other than one and two."""
        super().__post_init__()
        if self.values["filter_order"] not in (1.0, 2.0):
            raise ValueError(f"filter_order is 1 or 2, not {self.values['filter_order']}.")

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a random cut-off and either order."""
        values = super().draw(rng)
        values["filter_order"] = float(rng.integers(1, 3))
        return values

    def stage(self, shot: Shot) -> StateSpaceStage | None:
        """Return the low-pass."""
        cutoff = self.values["cutoff_hz"]
        if math.isinf(cutoff):
            return None
        if self.values["filter_order"] == 1.0:
            return lowpass_first(cutoff)
        return resonance(cutoff, math.sqrt(0.5), 1.0, 0.0)
