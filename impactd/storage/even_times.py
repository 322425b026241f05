"""The sampling rate of a column of times, as instruments print them.

An export rounds: at 25.6 kHz and steps of 10 us the times lie up to 5 us beside where the samples
were taken. Such times are even; the step of the printing says how far they may lie off.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

UNEVEN_TOLERANCE = 0.05
"""Of a sample's time: a clock that jitters more is no clock of a converter."""
_DIGITS = 6
"""A time printed with so few significant digits or more is taken as it stands."""
_ON_GRID = 1e-3
"""Of a step of the printing; doubles of a time in seconds carry 1e-16, differences ten times."""
_ROUNDED = 0.6
"""Of a step of the printing: rounding moves a time by a half, and the fitted line by a little."""
_FEW_ODD = 2
"""Steps unlike the others: a lost sample makes one. Rounding makes many, spread over the record."""
_GRIDS = tuple(m * 10.0**e for e in range(0, -10, -1) for m in (1.0, 0.5, 0.2))
"""Steps that times are printed in, coarse to fine. [unit of the times]"""


@dataclass(frozen=True)
class EvenTimes:
    """The sampling rate that a column of times has."""

    rate: float
    """Samples per unit of the times."""
    u_rate: float = 0.0
    """Standard uncertainty that rounded times leave; 0 where they are printed finely enough."""
    grid: float | None = None
    """Step that the times are rounded to, where that is coarse beside a sample's time."""


class UnevenTimesError(ValueError):
    """The times are not those of evenly taken samples, from ``row`` (counted from 1) on.

    The message continues a sentence about them.
    """

    def __init__(self, reason: str, row: int) -> None:
        self.reason = reason
        self.row = row
        super().__init__(reason)


def find_rate(times: NDArray[np.float64]) -> EvenTimes:
    """Return the rate of times that rise evenly, and its uncertainty from their rounding.

    ``times`` are n >= 2 finite values in any unit. Raises UnevenTimesError if they do not rise, or
    do not rise evenly.
    """
    count = times.size
    span = float(times[-1] - times[0])
    steps = np.diff(times)
    if not span > 0.0 or not np.all(steps >= 0.0):
        raise UnevenTimesError("has a time column that does not rise", 1)
    mean_step = span / (count - 1)
    # Judge each against the line, not against the last: rounding does not add up along a line.
    line = times[0] + np.arange(count) * mean_step
    off = np.abs(times - line)
    worst = int(np.argmax(off))
    printed = abs(float(times[worst])) * 10.0**-_DIGITS
    if off[worst] <= max(UNEVEN_TOLERANCE * mean_step, printed):
        if np.median(steps) <= 0.0:
            raise UnevenTimesError("has a time column that does not rise", 1)
        return EvenTimes((count - 1) / span)
    grid = _grid(times)
    fitted = None if grid is None else _fitted(times, grid)
    if fitted is None:
        raise UnevenTimesError(
            f"is not sampled evenly (row {worst + 1}, {times[worst]:g} s)", worst + 1
        )
    return fitted


def _grid(times: NDArray[np.float64]) -> float | None:
    """Return the coarsest step that all times are whole multiples of."""
    steps = np.diff(times)
    # two values on a grid are at least one step of it apart
    widest = float(np.min(steps[steps > 0.0])) * (1 + _ON_GRID)
    for grid in _GRIDS:
        if grid > widest:
            continue
        whole = times / grid
        if np.all(np.abs(whole - np.round(whole)) < _ON_GRID):
            return grid
    return None


def _fitted(times: NDArray[np.float64], grid: float) -> EvenTimes | None:
    """Return the rate of the line through rounded times, ``None`` where they lie off it."""
    steps = np.diff(times)
    if np.count_nonzero(np.abs(steps - np.median(steps)) > _ON_GRID * grid) <= _FEW_ODD:
        return None
    index = np.arange(times.size) - (times.size - 1) / 2
    weight = float(index @ index)
    step = float(index @ (times - times.mean())) / weight
    if np.max(np.abs(times - times.mean() - index * step)) > _ROUNDED * grid:
        return None
    # Rounding errors of neighbouring times are alike where the grid is wider than a sample's time.
    alike = max(1.0, grid / step)
    u_step = grid / np.sqrt(12.0) * np.sqrt(alike / weight)
    return EvenTimes(1 / step, float(u_step / step**2), grid)
