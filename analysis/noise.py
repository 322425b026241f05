r"""The noise of a recording: its level and its colour, from samples in which nothing happened.

The noise is described as autoregressive,

.. math:: n_t = \sum_j a_j n_{t-j} + e_t, \quad e_t \sim N(0, \sigma_e^2),

so that filtering a residual with :math:`1 - \sum_j a_j z^{-j}` makes it white. The order is chosen
by BIC over all quiet stretches of a campaign together, after what is slow enough to be mains hum
has been taken off. Where a part that rises like 1/f, or 1/f^2, describes the stretches better, it
is said so, and the filter is the long one that such noise obeys. How large it may be unseen is told
too.

Where the converter's step is larger than the noise, the quiet stretches say next to nothing, and
the error of rounding is the noise: ``analysis.quantisation``, ``analysis.hidden_noise``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from analysis import noise_slow
from analysis.hidden_noise import hidden_noise
from analysis.noise_products import white_products
from analysis.noise_slow import Slow
from analysis.quantisation import Coarse
from analysis.quiet_spectrum import (
    SHORTEST,
    Spectrum,
    drift_degree,
    pieces_of,
    pooled_spectrum,
    without_drift,
)

MAX_ORDER = 8
"""Highest autoregressive order that is tried."""
MIN_QUIET_SAMPLES = 200
"""Fewer quiet samples than this say too little about colour."""
SHORT_ORDER = 2
"""Highest autoregressive order that is tried beside a slow part."""
SLOW_PRICE = 6.0
"""What a slow part must bring in twice the logarithm of the likelihood. Every amplifier has one, so
it need not prove itself as a further order must; to whiten one that is not there does no harm."""
PROMISED_SHARE = 0.5
"""Of that price: what a score test must promise for a search. It promises rather too much."""
HIDDEN_SHARE = 0.1
"""Of the rounding error's variance, the most that a quiet record may hide for its spectrum to be
used. Derived: noise is then 0.22 steps or more. The part whose colour is not seen is 6 % of all
variance at most, less than the tenth that counts as structure (``Criteria.little``)."""


@dataclass(frozen=True)
class NoiseModel:
    """Autoregressive noise."""

    coefficients: NDArray[np.float64]
    """a_1 .. a_p; empty for white noise. [1]"""
    innovation_rms: float
    """Standard deviation of e. [unit of the signal]"""
    rms: float
    """Standard deviation of the noise itself. [unit of the signal]"""
    samples: int
    """Quiet samples it was learned from."""
    source: str
    """``"pre-trigger"``; ``"end"`` of the windows, or ``"differences"`` of neighbouring samples,
    where no record has a quiet stretch before the pulse."""
    short: NDArray[np.float64] | None = None
    """Coefficients of what is not slow, shape (q,); ``coefficients`` themselves where nothing is.
    [1]"""
    head: NDArray[np.float64] | None = None
    """Whitens the first p samples from those before each, in units of ``innovation_rms``; shape (p,
    p). Without it they only serve as history. A long filter needs it: what dies away within its
    length would be free. [1]"""
    corner: float = 0.0
    """Where a slow part is as strong as the rest at low frequency, 0 without one. [1/sample]"""
    slope: int = 1
    """The slow part rises like 1/f^slope."""
    corner_below: float | None = None
    """Largest corner that the quiet stretches allow, whether or not one was found; None where they
    say nothing. [1/sample]"""
    drift_rms: float | None = None
    """Rms of what was taken off the quiet stretches as slow, means aside; None where nothing was.
    [unit of the signal]"""
    drift_expected_rms: float = 0.0
    """What the noise itself would leave there. [unit of the signal]"""
    coarse: Coarse | None = None
    """What a converter's step hides; None where rounding is as good as white noise."""
    calm_share: float = 1.0
    """Of the quiet stretches, from their beginning: what follows is a precursor, no noise."""
    _of_taps: dict[int, NDArray[np.complex128]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )
    """The filter's Fourier transform by the number of samples that it is applied to."""

    @property
    def is_measured(self) -> bool:
        """Whether the level is that of quiet stretches, no guess."""
        return self.source != "differences"

    @property
    def order(self) -> int:
        """Return the autoregressive order."""
        return int(self.coefficients.size)

    @property
    def history(self) -> int:
        """Return how many samples at the start of a window are used up by whitening."""
        return self.order if self.head is None else 0

    def whiten(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return innovations in units of their standard deviation.

        ``values``, shape (n,) or (n, k), are residuals or columns of a Jacobian, equally spaced in
        time along axis 0. The first h samples, ``history``, serve only as such: n - h are returned.
        """
        if self.head is not None:
            return self._whiten_long(values, self.head)
        p = self.order
        n = values.shape[0]
        white = values[p:].copy(order="K")  # a Jacobian comes by columns and stays so
        for j, a in enumerate(self.coefficients, start=1):
            white -= a * values[p - j : n - j]
        white /= self.innovation_rms
        return white

    def products(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the inner products of rows of samples once they are white.

        ``rows``, shape (k, n), are residuals or derivatives, each equally spaced in time.
        """
        if self.head is None:
            found: NDArray[np.float64] = white_products(
                rows, self.coefficients, self.innovation_rms
            )
            return found
        white = self.whiten(rows.T)
        return np.asarray(white.T @ white)

    def _whiten_long(
        self, values: NDArray[np.float64], head: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the innovations of all samples, the filter applied by Fourier transform."""
        n, p = values.shape[0], min(self.order, values.shape[0])
        size = next_fast_len(n, real=True)  # what wraps around falls on the head
        if n not in self._of_taps:
            taps = np.concatenate([[1.0], -self.coefficients])[:n]
            self._of_taps[n] = rfft(taps, size)
        rows = values.T
        white = irfft(rfft(rows, size, axis=-1) * self._of_taps[n], size, axis=-1)[..., :n]
        white[..., :p] = rows[..., :p] @ head[:p, :p].T
        white /= self.innovation_rms
        return np.asarray(white.T)


def _autocovariance(
    segments: Sequence[NDArray[np.float64]], lags: int, sample_rate_hz: float | None
) -> NDArray[np.float64]:
    """Return the pooled autocovariance of segments whose own means, or drifts, are removed."""
    total = np.zeros(lags + 1)
    count = np.zeros(lags + 1)
    for segment in segments:
        degree = 0
        if sample_rate_hz is not None and segment.size >= SHORTEST:
            degree = drift_degree(segment.size, sample_rate_hz)
        x = without_drift(segment, degree)
        for lag in range(min(lags, x.size - 1) + 1):
            total[lag] += float(x[lag:] @ x[: x.size - lag])
            # each number taken off costs one degree of freedom at each lag
            count[lag] += max(x.size - lag - 1 - degree, 1)
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
    segments: Sequence[NDArray[np.float64]],
    *,
    quantum: float | None = None,
    sample_rate_hz: float | None = None,
) -> NoiseModel | None:
    """Return the noise model of quiet stretches.

    None if there are fewer than `MIN_QUIET_SAMPLES` in all.

    Parameters
    ----------
    segments : sequence of ndarray, shape (n_i,)
        Samples before anything happened, one array per record. [unit of the signal]
    quantum : float, optional
        Converter step; the level is never taken below its rounding noise, quantum / sqrt(12), and
        where the noise is smaller than half of it, `hidden_noise` tells it.
    sample_rate_hz : float, optional
        Of the records. With it, what is slow enough to be mains hum is not taken for noise, and a
        slow part is looked for; without it, only means are taken off.

    Notes
    -----
    Source: Yule-Walker equations by Levinson's recursion; order by BIC; a slow part by
    `analysis.noise_slow`. Validation: recovers AR(1) of known coefficient, and corners of known
    1/f and 1/f^2, in ``tests/analysis/test_noise.py`` and ``test_noise_slow.py``.
    """
    pieces = segments
    if sample_rate_hz is not None:
        pieces = [one for whole in segments for one in pieces_of(whole, sample_rate_hz)]
    usable = [s for s in pieces if s.size > 4 * MAX_ORDER]
    samples = sum(s.size for s in usable)
    if samples < MIN_QUIET_SAMPLES:
        return None
    hidden = None if quantum is None else hidden_noise(usable, quantum)
    if hidden is not None:
        coarse = _coarse_model(*hidden, samples)
        if sample_rate_hz is None or hidden[0].hidden > HIDDEN_SHARE:
            return coarse
        gamma = _autocovariance(usable, MAX_ORDER, sample_rate_hz)
        return _with_slow_part(coarse, usable, sample_rate_hz, gamma)
    gamma = _autocovariance(usable, MAX_ORDER, sample_rate_hz)
    floor = 0.0 if quantum is None else quantum / math.sqrt(12)
    if gamma[0] <= floor**2 or gamma[0] == 0.0:
        level = max(math.sqrt(gamma[0]), floor)
        if level == 0.0:
            return None
        return NoiseModel(np.zeros(0), level, level, samples, "pre-trigger")
    short, variance = _by_bic(gamma, samples)
    plain = NoiseModel(short, math.sqrt(variance), math.sqrt(gamma[0]), samples, "pre-trigger")
    if sample_rate_hz is not None:
        plain = _with_slow_part(plain, usable, sample_rate_hz, gamma)
    return plain


def _with_slow_part(
    plain: NoiseModel,
    usable: Sequence[NDArray[np.float64]],
    sample_rate_hz: float,
    gamma: NDArray[np.float64],
) -> NoiseModel:
    """Return autoregressive noise with its slow part if there is one, and with what limits it.

    The quiet record of a coarse converter hides a part of the rounding error, which is added as
    white noise.
    """
    seen = pooled_spectrum(usable, sample_rate_hz)
    if seen is None:
        return plain
    best = flat = noise_slow.autoregressive(seen, plain.coefficients)
    found = _rising(seen, flat, gamma)
    if found is not None:
        # noise of 1/f^2 shows as 1/f first
        steep = pooled_spectrum(usable, sample_rate_hz, slope=2)
        steeper = None if steep is None else _rising(steep, flat, gamma)
        if steep is not None and steeper is not None and steeper[1] < found[1]:
            seen, found = steep, steeper
        best = found[0]
    model = plain
    if best is not flat:
        coarse = plain.coarse
        unseen = 0.0 if coarse is None else coarse.hidden * coarse.step**2 / 12.0
        whole = replace(best, innovation=best.innovation + unseen)
        model = _rising_model(whole, seen.samples, plain.samples)
    expected = noise_slow.drift_expected(seen, best)
    return replace(
        model,
        coarse=plain.coarse,
        slope=best.slope,
        corner_below=noise_slow.largest_corner(seen, best.short),
        drift_rms=math.sqrt(seen.drift / seen.samples),
        drift_expected_rms=math.sqrt(expected / seen.samples),
    )


def _coarse_model(coarse: Coarse, covariance: NDArray[np.float64], samples: int) -> NoiseModel:
    """Return the noise of a converter whose step hides it."""
    short, variance = _by_bic(covariance, samples)
    level = coarse.step * math.sqrt(covariance[0])
    innovation = coarse.step * math.sqrt(variance)
    return NoiseModel(short, innovation, level, samples, "pre-trigger", coarse=coarse)


def _rising_model(found: Slow, piece: int, samples: int) -> NoiseModel:
    """Return noise with a slow part as a filter."""
    taps, variance, head = noise_slow.whitening_filter(found)
    return NoiseModel(
        taps,
        math.sqrt(variance),
        math.sqrt(noise_slow.variance_within(found, piece)),
        samples,
        "pre-trigger",
        short=found.short,
        head=head,
        corner=found.corner,
    )


def _by_order(gamma: NDArray[np.float64]) -> Iterator[tuple[NDArray[np.float64], float]]:
    """Yield coefficients and innovation variance of one autoregressive order after the other."""
    a, variance = np.zeros(0), float(gamma[0])
    while variance > 0.0:
        yield a, variance
        if a.size == MAX_ORDER:
            return
        a, variance = _one_order_more(gamma, a, variance)


def _by_bic(gamma: NDArray[np.float64], samples: int) -> tuple[NDArray[np.float64], float]:
    """Return the coefficients and innovation variance of the order that BIC prefers."""
    return min(
        _by_order(gamma),
        key=lambda found: samples * math.log(found[1]) + found[0].size * math.log(samples),
    )


def _rising(seen: Spectrum, flat: Slow, gamma: NDArray[np.float64]) -> tuple[Slow, float] | None:
    """Return noise with a slow part where that is worth its price, and what it costs, else None.

    Minus twice the logarithm of its likelihood, and the prices of its numbers.
    """
    price = math.log(seen.pieces * seen.samples)
    best, least = None, -2.0 * flat.likelihood + flat.short.size * price
    for short, _ in islice(_by_order(gamma), min(flat.short.size, SHORT_ORDER) + 1):
        # a search costs more than all the rest of a shot's fit: only where it may be worth it
        if noise_slow.promised_gain(seen, short) < PROMISED_SHARE * SLOW_PRICE:
            continue
        found = noise_slow.with_slow_part(seen, short)
        without = max(noise_slow.autoregressive(seen, a).likelihood for a in (short, found.short))
        worth = 2.0 * (found.likelihood - without) > SLOW_PRICE
        cost = -2.0 * found.likelihood + short.size * price + SLOW_PRICE
        if worth and cost < least and found.corner < noise_slow.FURTHEST_CORNER:
            best, least = found, cost
    return None if best is None else (best, least)


def noise_from_differences(signals: Sequence[NDArray[np.float64]]) -> NoiseModel:
    """Return a white noise level for records that have no quiet stretch.

    ``signals`` are whole records. The level is an upper bound with smooth signals. Source: median
    absolute third difference over sqrt(20) x 0.6745, which a smooth pulse hardly touches. Colour
    cannot be seen this way and is not claimed.
    """
    third = np.concatenate([np.abs(np.diff(s, 3)) for s in signals])
    level = float(np.median(third)) / 0.6745 / math.sqrt(20.0)
    if level == 0.0:
        level = float(np.mean(third)) / math.sqrt(20.0) or 1.0
    return NoiseModel(np.zeros(0), level, level, int(third.size), "differences")
