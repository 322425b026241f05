"""Invented: an input stage that jumps between two levels at its own times (burst noise).

``+-a``, changing after times that are exponentially distributed. Source: random telegraph signal
(Machlup 1954). There before the trigger, never in step with anything. Outside the library on
purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot


class PopcornNoise(Effect):
    """An input that jumps."""

    id = "x_popcorn_noise"
    slot = "electronics"
    order = 84
    parameters = (
        Parameter("amplitude_v", "V", 5e-4, 0.05, 0.0, "a"),
        Parameter("dwell_s", "s", 5e-5, 1e-3, 2e-4, "mean time on one level"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the jumps of this shot."""
        if self.values["amplitude_v"] == 0.0 or t_s.size == 0:
            return None
        mean = (t_s[-1] - t_s[0]) / self.values["dwell_s"]
        jumps = np.sort(shot.rng.uniform(t_s[0], t_s[-1], shot.rng.poisson(mean)))
        level = np.searchsorted(jumps, t_s) % 2
        return np.asarray(self.values["amplitude_v"] * (2.0 * level - 1.0))
