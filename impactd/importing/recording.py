"""The common result of all readers, whatever the kind of file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Channel:
    """One signal of a file: a long record, or one trace for each hit."""

    name: str
    """As the file calls it, or ``column 2``."""
    number: int
    """The column, counted from 1 as in the file."""
    traces: tuple[NDArray[np.float64], ...]
    """Each of shape (n,), in the file's own unit."""
    unit: str | None = None
    """As the file writes it."""
    step: float | None = None
    """Distance of two neighbouring values of the converter, in the file's unit."""


@dataclass(frozen=True)
class Recording:
    """One file, read."""

    file: str
    """Its name, without folders."""
    channels: tuple[Channel, ...]
    """At least one; never the time."""
    rate_hz: float | None = None
    """As the file states it, with times taken in ``time_unit``. [Hz]"""
    u_rate_hz: float = 0.0
    """Standard uncertainty that printed times leave of the rate. [Hz]"""
    time_unit: str | None = None
    """Unit that the file states of its times; ``None`` where it states none, or has no times."""
    has_times: bool = False
    """Whether the rate comes from a column of times."""
    assumed: tuple[str, ...] = ()
    """A sentence for each assumption where the file says nothing."""
