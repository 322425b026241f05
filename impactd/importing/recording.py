"""What every reader returns, whatever the kind of file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Channel:
    """One signal of a file: a long record, or one trace for each hit.

    Attributes
    ----------
    name : str
        As the file calls it, or ``column 2``.
    number : int
        The column, counted from 1 as in the file.
    traces : tuple of ndarray, each of shape (n,)
        In the file's own unit.
    unit : str or None
        As the file writes it.
    step : float or None
        Distance of two neighbouring values of the converter, in the file's unit.
    """

    name: str
    number: int
    traces: tuple[NDArray[np.float64], ...]
    unit: str | None = None
    step: float | None = None


@dataclass(frozen=True)
class Recording:
    """One file, read.

    Attributes
    ----------
    file : str
        Its name, without folders.
    channels : tuple of Channel
        At least one; never the time.
    rate_hz : float or None
        What the file says of its sampling rate, with times taken in ``time_unit``. [Hz]
    u_rate_hz : float
        Standard uncertainty that printed times leave of the rate. [Hz]
    time_unit : str or None
        Unit that the file states of its times; ``None`` where it states none, or has no times.
    has_times : bool
        Whether the rate comes from a column of times.
    assumed : tuple of str
        A sentence for each thing that the file does not say and that was taken to be so.
    """

    file: str
    channels: tuple[Channel, ...]
    rate_hz: float | None = None
    u_rate_hz: float = 0.0
    time_unit: str | None = None
    has_times: bool = False
    assumed: tuple[str, ...] = ()
