"""Mains on the line: harmonics of 50 or 60 Hz, falling as 1/n, phase free from shot to shot.

The mains runs on whether or not anything falls, so its phase against the impact is free by itself.
Source: own. Tell-tale: present before the trigger (tested).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter


class MainsHum(Effect):
    """Hum of the mains."""

    id = "mains_hum"
    slot = "electronics"
    order = 80
    parameters = (
        Parameter("amplitude_v", "V", 5e-4, 0.15, 0.0, "of the fundamental"),
        Parameter("frequency_hz", "Hz", 50.0, 60.0, 50.0, "of the mains"),
        Parameter("harmonics", "1", 1.0, 7.0, 1.0, "how many odd harmonics"),
    )

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return a random amplitude of either mains with one to four odd harmonics."""
        values = super().draw(rng)
        values["frequency_hz"] = float(rng.choice([50.0, 60.0]))
        values["harmonics"] = float(rng.integers(1, 5))
        return values

    def ambient(self, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the hum."""
        if self.values["amplitude_v"] == 0.0:
            return None
        phase = 2.0 * np.pi * self.values["frequency_hz"] * t_s
        hum = np.zeros_like(t_s)
        for i in range(round(self.values["harmonics"])):
            n = 2 * i + 1
            hum += np.sin(n * phase + 1.7 * i) / n
        return np.asarray(self.values["amplitude_v"] * hum)
