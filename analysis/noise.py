r"""The noise of a recording: its level and its colour, from samples in which nothing happened.

The noise is described as autoregressive,

.. math:: n_t = \sum_j a_j n_{t-j} + e_t, \quad e_t \sim N(0, \sigma_e^2),

so that filtering a residual with :math:`1 - \sum_j a_j z^{-j}` makes it white. The order is chosen
by BIC over all quiet stretches of a campaign together.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAX_ORDER = 8
"""Highest autoregressive order that is tried."""
MIN_QUIET_SAMPLES = 200
"""Fewer quiet samples than this say too little about colour."""


@dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise.

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
        a_1 .. a_p; empty for white noise. [1]
    innovation_rms : float
        Standard deviation of e. [unit of the signal]
    rms : float
        Standard deviation of the noise itself. [unit of the signal]
    samples : int
        Quiet samples it was learned from.
    source : str
        ``"pre-trigger"``, or ``"differences"`` where no record has a quiet stretch.
    """

    coefficients: NDArray[np.float64]
    innovation_rms: float
    rms: float
    samples: int
    source: str

    @property
    def order(self) -> int:
        """Return the autoregressive order."""
        return int(self.coefficients.size)

    def whiten(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return innovations in units of their standard deviation.

        Parameters
        ----------
        values : ndarray, shape (n,) or (n, k)
            Residuals, or columns of a Jacobian, equally spaced in time along axis 0.

        Returns
        -------
        ndarray, shape (n - p,) or (n - p, k)
            Whitened values; the first p samples only serve as history. [1]
        """
        p = self.order
        n = values.shape[0]
        white = values[p:].copy(order="K")  # a Jacobian comes by columns and stays so
        for j, a in enumerate(self.coefficients, start=1):
            white -= a * values[p - j : n - j]
        white /= self.innovation_rms
        return white


def _autocovariance(segments: Sequence[NDArray[np.float64]], lags: int) -> NDArray[np.float64]:
    """Return the pooled autocovariance of segments whose own means are removed."""
    total = np.zeros(lags + 1)
    count = np.zeros(lags + 1)
    for segment in segments:
        x = segment - segment.mean()
        for lag in range(min(lags, x.size - 1) + 1):
            total[lag] += float(x[lag:] @ x[: x.size - lag])
            # the mean costs one degree of freedom at each lag
            count[lag] += x.size - lag - 1 if x.size > lag + 1 else 1
    return np.asarray(total / np.maximum(count, 1))


def _one_order_more(
    gamma: NDArray[np.float64], a: NDArray[np.float64], variance: float
) -> tuple[NDArray[np.float64], float]:
    """Return the Yule-Walker solution of one order more (Levinson's recursion)."""
    order = a.size
    reflection = float(gamma[order + 1] - a @ gamma[order:0:-1]) / variance
    longer = np.append(a - reflection * a[::-1], reflection)
    return longer, variance * (1 - reflection**2)


def estimate_noise(
    segments: Sequence[NDArray[np.float64]], *, quantum: float | None = None
) -> NoiseModel | None:
    """Return the noise model of quiet stretches, or None where they say too little.

    Parameters
    ----------
    segments : sequence of ndarray, shape (n_i,)
        Samples before anything happened, one array per record. [unit of the signal]
    quantum : float, optional
        Converter step; the level is never taken below its rounding noise, quantum / sqrt(12).

    Returns
    -------
    NoiseModel or None
        None when there are fewer than `MIN_QUIET_SAMPLES` in all.

    Notes
    -----
    Source: Yule-Walker equations by Levinson's recursion; order by BIC. Validation: recovers AR(1)
    of known coefficient in ``tests/analysis/test_noise.py``.
    """
    usable = [s for s in segments if s.size > 4 * MAX_ORDER]
    samples = sum(s.size for s in usable)
    if samples < MIN_QUIET_SAMPLES:
        return None
    floor = 0.0 if quantum is None else quantum / math.sqrt(12)
    gamma = _autocovariance(usable, MAX_ORDER)
    if gamma[0] <= floor**2 or gamma[0] == 0.0:
        level = max(math.sqrt(gamma[0]), floor)
        if level == 0.0:
            return None
        return NoiseModel(np.zeros(0), level, level, samples, "pre-trigger")
    best: tuple[float, NDArray[np.float64], float] | None = None
    a, variance = np.zeros(0), float(gamma[0])
    for order in range(MAX_ORDER + 1):
        if order:
            a, variance = _one_order_more(gamma, a, variance)
        if variance <= 0:
            break
        bic = samples * math.log(variance) + order * math.log(samples)
        if best is None or bic < best[0]:
            best = (bic, np.asarray(a), variance)
    assert best is not None
    return NoiseModel(best[1], math.sqrt(best[2]), math.sqrt(gamma[0]), samples, "pre-trigger")


def noise_from_differences(signals: Sequence[NDArray[np.float64]]) -> NoiseModel:
    """Return a white noise level for records that have no quiet stretch.

    Parameters
    ----------
    signals : sequence of ndarray, shape (n_i,)
        Whole records. [unit of the signal]

    Returns
    -------
    NoiseModel
        White, ``source = "differences"``: an upper bound with smooth signals, no knowledge of
        colour.

    Notes
    -----
    Source: median absolute third difference over sqrt(20) x 0.6745, which a smooth pulse hardly
    touches. Colour cannot be seen this way and is not claimed.
    """
    third = np.concatenate([np.abs(np.diff(s, 3)) for s in signals])
    level = float(np.median(third)) / 0.6745 / math.sqrt(20.0)
    if level == 0.0:
        level = float(np.mean(third)) / math.sqrt(20.0) or 1.0
    return NoiseModel(np.zeros(0), level, level, int(third.size), "differences")
