"""Invented: the baseline walks at random, every shot on a way of its own.

Sum of independent steps, a in one millisecond. Source: own; a leaking input capacitor. There
before the trigger, and in step with nothing. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot

SCALE_S = 1e-3


class WanderingBaseline(Effect):
    """A baseline that walks at random."""

    id = "x_wandering_baseline"
    slot = "electronics"
    order = 88
    parameters = (
        Parameter("walk_v", "V", 5e-4, 0.1, 0.0, "a, standard deviation after one millisecond"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return this shot's way."""
        if self.values["walk_v"] == 0.0 or t_s.size < 2:
            return None
        steps = shot.rng.standard_normal(t_s.size)
        share = np.sqrt(np.diff(t_s, prepend=t_s[0]) / SCALE_S)
        return np.asarray(self.values["walk_v"] * np.cumsum(share * steps))
