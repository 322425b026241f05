"""Low-pass of the amplifier or in front of the converter, order 1 to 8.

``butterworth`` (1930; order 1 is an RC), ``bessel`` (Thomson 1949), ``rc`` (as many equal RC
sections as the order says); the cut-off is where each is 3 dB down.
Tell-tale: delay, lower ring (tested).
"""

from __future__ import annotations

import math

import numpy as np

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Stage
from drivers.simulated.filters import bessel, butterworth, rc_sections

_FORMS = {"butterworth": butterworth, "bessel": bessel, "rc": rc_sections}


class AmplifierLowpass(Effect):
    """A slow amplifier."""

    id = "amplifier_lowpass"
    slot = "electronics"
    order = 50
    fine_grid = True
    forms = tuple(_FORMS)
    parameters = (
        Parameter("cutoff_hz", "Hz", 1e4, 5e5, math.inf, "-3 dB frequency"),
        Parameter("filter_order", "1", 1.0, 2.0, 1.0, "1 to 8; 1 or 2 when drawn for the paper"),
    )

    def __post_init__(self) -> None:
        """Refuse orders other than one to eight."""
        super().__post_init__()
        if self.values["filter_order"] not in range(1, 9):
            raise ValueError(f"filter_order is 1 to 8, not {self.values['filter_order']}.")

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a random cut-off and order one or two."""
        values = super().draw(rng)
        values["filter_order"] = float(rng.integers(1, 3))
        return values

    @classmethod
    def draw_form(
        cls, rng: np.random.Generator, values: dict[str, float]
    ) -> tuple[str, dict[str, float]]:
        """Return a form and any order: what stands before converters has up to eight poles."""
        form, values = super().draw_form(rng, values)
        return form, {**values, "filter_order": float(rng.integers(1, 9))}

    def stage(self, shot: Shot) -> Stage | None:
        """Return the low-pass."""
        cutoff = self.values["cutoff_hz"]
        if math.isinf(cutoff):
            return None
        return _FORMS[self.form](cutoff, int(self.values["filter_order"]))
