r"""The effect of a converter's step on a signal, where it is larger than the noise.

Noise of half a step or more makes the error of rounding what one likes it to be: uniform, white, of
variance :math:`q^2/12`, whatever the signal does (Sheppard's correction; Widrow & Kollar 2008).
With less noise that holds only where the signal itself crosses steps from one sample to the next. A
signal that rests within a step keeps one error for as long as it rests, and the quiet stretch
before the trigger shows neither that error nor the noise.

So the noise is inferred from how often the codes change, its colour from how the changes go
together (Van Vleck's correction), the rounding error is added, and every stretch of record that
stays within one step counts as one value: its samples share the weight of one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.aliases import Array

LEVELS = 16
"""Distinct values that a record must have for its smallest difference to be a converter's step."""
REACH = 3.5
"""Standard deviations that one sample in two thousand exceeds."""
_LOOKED = 8192
_NEAR_STEPS = 8.0
_OFF_STEP = 0.1


def step_of(signal: Array, declared: float | None = None) -> float | None:
    """Return the step of the converter that made a record.

    The smallest difference of its values where all small differences are multiples of it; else as
    declared. The record has a pulse in it. Records of fewer bits in codes of more have a larger
    step than is declared.
    """
    values = np.unique(signal[:_LOOKED])
    if values.size < LEVELS:
        return declared
    differences = np.diff(values)
    # the same code may have been turned into numbers in two ways that differ by rounding
    differences = differences[differences > 1e-6 * differences.max()]
    near = differences[differences < 1.5 * differences.min()]
    step = float(np.median(near))
    small = differences[differences < _NEAR_STEPS * step] / step
    if np.any(np.abs(small - np.rint(small)) > _OFF_STEP):
        return declared
    # values that hardly ever neighbour one another show a multiple of their step by chance
    found = step if near.size >= LEVELS // 2 else None
    if declared is None or (found is not None and found > 1.5 * declared):
        return found
    return declared


@dataclass(frozen=True)
class Coarse:
    """A converter whose step hides the noise in part."""

    step: float
    """[unit of the signal]"""
    noise: float
    least_noise: float
    """``noise`` and this are standard deviations, the largest and the smallest that the codes
    allow. [step]"""

    @property
    def hidden(self) -> float:
        """Return the largest share of the rounding error's variance that a quiet record hides."""
        return kept_share(self.least_noise)

    @property
    def kept(self) -> float:
        """Return the largest share of the variance that a signal at rest keeps while it rests."""
        return self.hidden / (1.0 + 12.0 * self.noise**2)

    @property
    def codes(self) -> int:
        """Return by how many codes a record at rest may move.

        One, as the level may lie on an edge, and what noise of `REACH` deviations adds to both
        sides: a stretch that noise alone ended would be chosen for its noise.
        """
        return 1 + math.floor(0.5 + 2.0 * REACH * self.noise)


def kept_share(noise: float) -> float:
    r"""Return the share of the rounding error's variance that a resting signal keeps.

    .. math:: \frac{6}{\pi^2} \sum_k k^{-2} e^{-4 \pi^2 k^2 s^2}

    s is the standard deviation of the noise in steps; the share is 1 without noise. Source: the
    Fourier series of the rounding error, averaged over the noise, its square averaged over all
    levels (Widrow & Kollar 2008).
    """
    k = np.arange(1.0, 201.0)
    share = 6.0 / np.pi**2 * np.sum(np.exp(-((2.0 * np.pi * k * noise) ** 2)) / k**2)
    return float(share)


@njit(cache=True, nogil=True)
def _starts(codes, most):  # type: ignore[no-untyped-def]
    found = np.empty(codes.size, dtype=np.int64)
    count, low, high = 0, 0, 0
    for i in range(codes.size):
        low, high = min(low, codes[i]), max(high, codes[i])
        if i == 0 or high - low > most:
            found[count] = i
            count += 1
            low = high = codes[i]
    return found[:count]


def starts_of_rest(signal: Array, coarse: Coarse) -> NDArray[np.int64]:
    """Return the first samples of the stretches in which the codes say that a record is at rest.

    Sample 0 is among them. Where the signal moves by more than ``coarse.codes`` a sample, each
    sample is a stretch of its own.
    """
    codes = np.rint((signal - signal[0]) / coarse.step).astype(np.int64)
    return np.asarray(_starts(codes, coarse.codes))


def weights_at_rest(signal: Array, coarse: Coarse, *, memory: float = 1.0) -> Array:
    r"""Return the weights of whitened samples whose rounding errors go together while they rest.

    .. math:: w = (1 + k \mu^2 (l - 1))^{-1/2}

    for stretches of l samples, k = ``coarse.kept``; :math:`\mu` = ``memory`` is what whitening
    makes of a constant of one standard deviation. [1] The weights give a constant's information its
    true size. Noise leaves :math:`w^2` squares of a sample, whether the signal rests or passes.
    """
    starts = starts_of_rest(signal, coarse)
    lengths = np.diff(starts, append=signal.size)
    shared = 1.0 + coarse.kept * memory**2 * (lengths - 1.0)
    return np.asarray(np.repeat(shared**-0.5, lengths))
