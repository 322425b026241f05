"""Is what comes before the trigger noise? Spikes and jumps are there all the time, and are not.

No impact causes them, so no residual repeats and every test for structure takes them for noise. But
noise of amplifiers and converters is Gaussian, and a Gaussian's fourth moment is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from analysis.fit.problem import FitShot
from analysis.fit.window import quiet_part

Array = NDArray[np.float64]

CLEAR = 6.0
"""Standard errors of the excess kurtosis: 1e-9 of Gaussian noise, left room as its law has a tail."""
FAR = 5.0
"""Standard deviations that one sample in two million exceeds."""
LEAST_QUIET, LEAST_IN_ALL = 200, 2000
LEAST_STEPS = 0.75
"""Of the converter, to a standard deviation: rounding then moves the kurtosis by less than 1e-3."""


@dataclass(frozen=True)
class Spikes:
    """How far the noise before the trigger is from Gaussian.

    Attributes
    ----------
    samples : int
        Whitened quiet samples that were looked at.
    far : int
        Of these, beyond `FAR` standard deviations, as the median tells them.
    excess_kurtosis : float
        Fourth moment over the squared second, less 3. [1]
    """

    samples: int
    far: int
    excess_kurtosis: float

    @property
    def clear(self) -> bool:
        """Whether no Gaussian noise is like that."""
        if self.samples < LEAST_IN_ALL:
            return False
        return self._deviation > CLEAR

    @property
    def p_value(self) -> float:
        """Return the chance of as large a kurtosis in Gaussian noise."""
        return float(norm.sf(self._deviation)) if self.samples >= LEAST_IN_ALL else 1.0

    @property
    def _deviation(self) -> float:
        return self.excess_kurtosis / math.sqrt(24.0 / self.samples)


def spikes(shots: Sequence[FitShot]) -> Spikes:
    """Return how spiky the records are before anything falls.

    Parameters
    ----------
    shots : sequence of FitShot
        With their quiet stretches and their noise.

    Returns
    -------
    Spikes
        Each record measured by its own level, so that records of different noise make no tail.

    Notes
    -----
    The standard error of the kurtosis of n Gaussian samples is sqrt(24/n) (Kendall and Stuart,
    *The Advanced Theory of Statistics* 1, 12.18); whitened samples are as good as independent.
    """
    whole = [w for w in (_whitened(item) for item in shots) if w.size]
    if not whole:
        return Spikes(0, 0, 0.0)
    pooled = np.concatenate(whole)
    far = sum(int(np.sum(np.abs(w) > FAR * float(np.median(np.abs(w))) / 0.6745)) for w in whole)
    return Spikes(pooled.size, far, float(np.mean(pooled**4)) - 3.0)


def _whitened(item: FitShot) -> Array:
    """Return a record's quiet samples, whitened, of mean 0 and standard deviation 1.

    None where the converter's step hides the noise: what is left of it are rare single steps.
    """
    quiet = quiet_part(item.shot)
    if quiet.size < LEAST_QUIET:
        return np.zeros(0)
    steps = np.diff(np.unique(quiet))
    if steps.size == 0 or np.std(quiet) < LEAST_STEPS * steps.min():
        return np.zeros(0)
    white = item.noise.whiten(quiet - quiet.mean())
    white = white - white.mean()
    level = float(np.std(white))
    return np.asarray(white / level) if level > 0.0 else np.zeros(0)
