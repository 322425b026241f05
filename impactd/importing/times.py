"""The sampling rate of a column of times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from impactd.importing.errors import RecordingError
from impactd.importing.units import TIME_FACTORS
from impactd.storage.even_times import UnevenTimesError, find_rate


@dataclass(frozen=True)
class Rate:
    """A rate, the uncertainty that the times leave, and the assumptions in words."""

    rate_hz: float
    u_rate_hz: float
    said: list[str]


def rate_of_times(file: str, times: NDArray[np.float64], unit: str | None) -> Rate:
    """Return the rate of a column of times, shape (n,), as they stand in the file.

    Without a unit they count as seconds. Raises RecordingError if they do not rise evenly.
    """
    try:
        even = find_rate(times)
    except UnevenTimesError as error:
        raise RecordingError(
            file,
            f"{error.reason}.",
            "Export it again without gaps, one recording a file, or give --rate HZ if the times "
            "are wrong.",
        ) from error
    factor = TIME_FACTORS[unit or "s"]
    rate, u_rate = even.rate / factor, even.u_rate / factor
    said = []
    if even.grid is not None:
        said.append(
            f"{file}: times are rounded to {even.grid:g} {unit or 's'}; the samples are taken to "
            f"be evenly spaced, {rate:.7g} Hz with a standard uncertainty of {u_rate:.2g} Hz."
        )
    return Rate(_rounded(rate), u_rate, said)


def counts_samples(values: NDArray[np.float64]) -> bool:
    """Return whether a column is 0, 1, 2 ... or 1, 2, 3 ..."""
    return bool(values.size > 2 and values[0] in (0.0, 1.0) and np.all(np.diff(values) == 1.0))


def _rounded(rate_hz: float) -> float:
    """Return a rate without the last digits, which come from rounding and not from the clock."""
    return float(f"{rate_hz:.9g}")
