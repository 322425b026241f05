"""Invented: short spikes at arbitrary times, as a motor next door or a bad plug makes them.

``+-a exp(-t/tau)``, tau = 3 us, after intervals that are exponentially distributed, sizes too.
Source: own; shot noise of large charges. There before the trigger, never in step with anything.
Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot

DECAY_S = 3e-6
FOLLOWED = 10.0  # times the decay


class Glitches(Effect):
    """Spikes on the line."""

    id = "x_glitches"
    slot = "electronics"
    order = 86
    parameters = (
        Parameter("amplitude_v", "V", 3e-3, 0.3, 0.0, "a, mean size"),
        Parameter("rate_hz", "1/s", 300.0, 1e4, 1e3, "spikes in a second"),
    )

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the spikes of this shot."""
        if self.values["amplitude_v"] == 0.0 or t_s.size == 0:
            return None
        rng = shot.rng
        count = int(rng.poisson((t_s[-1] - t_s[0]) * self.values["rate_hz"]))
        spikes = np.zeros_like(t_s)
        for at in rng.uniform(t_s[0], t_s[-1], count):
            size = self.values["amplitude_v"] * rng.exponential() * rng.choice((-1.0, 1.0))
            a, b = np.searchsorted(t_s, (at, at + FOLLOWED * DECAY_S))
            spikes[a:b] += size * np.exp(-(t_s[a:b] - at) / DECAY_S)
        return spikes
