"""Invented: the moments of the samples scatter, each by itself.

``V(t - s z)``, z a standard normal number of every sample; to first order noise of the size
of the slope. Source: own; aperture jitter of any converter. A scatter that nothing repeats, and
that is there only while the signal moves. Outside the library on purpose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.effects.effect import Effect, Parameter, Shot
from drivers.simulated.electronics import Memoryless


class _Jitter(Memoryless):
    def __init__(self, jitter_s: float, rng: np.random.Generator) -> None:
        self._jitter_s, self._rng = jitter_s, rng

    def process(self, volts: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
        if volts.size < 2:
            return volts
        late = self._jitter_s * self._rng.standard_normal(volts.size)
        return np.asarray(volts - late * np.gradient(volts, step_s))


class SampleJitter(Effect):
    """A converter that is now early, now late."""

    id = "x_sample_jitter"
    slot = "electronics"
    order = 89
    parameters = (Parameter("jitter_s", "s", 3e-9, 3e-7, 0.0, "s"),)

    def stage(self, shot: Shot) -> _Jitter | None:
        """Return the jitter of this shot."""
        jitter = self.values["jitter_s"]
        return None if jitter == 0.0 else _Jitter(jitter, shot.rng)
