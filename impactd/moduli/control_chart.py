"""The control chart of a pair: every shot's reduced modulus, in order, between its limits.

Limits are those of a chart of individual values with moving ranges (ISO 7870-2): mean +- 3 sigma,
where sigma is the mean moving range over 1.128, the expectation of the range of two normal values
(d2). Neighbouring shots make it, so that a slow drift does not widen the limits that should show
it. Logarithms are charted: the scatter of a modulus is relative.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RANGE_OF_TWO = 1.128
"""d2 of two values: mean range over standard deviation (ISO 7870-2, table 2)."""
FEWEST = 8
"""Shots that limits are made of. With fewer the estimate of sigma scatters by a third and more
(its relative standard deviation is about 0.87 / sqrt(n - 1)), and limits would mean little."""


@dataclass(frozen=True)
class PairChart:
    """Every shot of a pair."""

    numbers: tuple[int, ...]
    """Of the shots, in their order."""
    started_utc: tuple[str, ...]
    log_modulus: NDArray[np.float64]
    """ln E*, E* in Pa. Shape (n,)."""
    u_random: NDArray[np.float64]
    """Standard uncertainty of ln E* from each recording alone. Shape (n,). [1]"""

    @property
    def centre(self) -> float:
        """Mean of ln E*."""
        return float(self.log_modulus.mean())

    @property
    def scatter(self) -> float | None:
        """Standard deviation of ln E* from shot to shot, ``None`` for one shot. [1]"""
        return float(self.log_modulus.std(ddof=1)) if self.log_modulus.size > 1 else None

    @property
    def limits(self) -> tuple[float, float] | None:
        """Lower and upper limit of ln E*, ``None`` where too few shots make them."""
        if self.log_modulus.size < FEWEST:
            return None
        sigma = float(np.abs(np.diff(self.log_modulus)).mean()) / RANGE_OF_TWO
        return self.centre - 3.0 * sigma, self.centre + 3.0 * sigma

    def outside(self) -> list[int]:
        """Return the indices of the shots outside the limits."""
        if self.limits is None:
            return []
        low, high = self.limits
        return np.flatnonzero((self.log_modulus < low) | (self.log_modulus > high)).tolist()

    def places(self, most: int) -> list[int]:
        """Return the indices to draw, rising: all, or the extremes of even stretches.

        Every shot outside the limits is among them.
        """
        size = self.log_modulus.size
        if size <= most:
            return list(range(size))
        kept = set(self.outside()) | {0, size - 1}
        for part in np.array_split(np.arange(size), max(1, most // 2)):
            values = self.log_modulus[part]
            kept |= {int(part[values.argmin()]), int(part[values.argmax()])}
        return sorted(kept)


def trend(chart: PairChart) -> dict[str, float] | None:
    """Return the change of E* from the first to the last of at least three shots, by a line.

    ``relative``, and its standard uncertainty ``u`` from the scatter about the line. [1]
    """
    values = chart.log_modulus
    if values.size < 3:
        return None
    place = np.linspace(-0.5, 0.5, values.size)
    slope = float(place @ values / (place @ place))
    rest = values - values.mean() - slope * place
    u = math.sqrt(float(rest @ rest) / (values.size - 2) / float(place @ place))
    return {"relative": slope, "u": u}
