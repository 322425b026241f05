"""A bulk endpoint read by pyusb, with blocking reads in sequence."""

from __future__ import annotations

import array
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import usb.core

from drivers.usb_errors import translated

READ_TIMEOUT_S = 0.1


class SynchronousBulkSource:
    """A `drivers.usb_stream.BulkSource` of blocking reads.

    Every read is done within what ``in_use`` returns, which may refuse, e.g. once the board was
    given back. libusb returns what it has when time is up and reports a time-out at zero bytes
    only. Between two reads nothing is queued: a board whose FIFO is shorter than that gap overruns
    (FIFO depth of the 3500: NOT KNOWN).
    """

    def __init__(
        self,
        device: Any,
        endpoint: int,
        timeout_s: float = READ_TIMEOUT_S,
        *,
        in_use: Callable[[], AbstractContextManager[None]] = nullcontext,
    ) -> None:
        self._device = device
        self._endpoint = endpoint
        self._in_use = in_use
        self._timeout_ms = max(1, round(timeout_s * 1000))

    def queue(self) -> None:
        """Do nothing: a synchronous read cannot be queued."""

    def read_into(self, buffer: array.array[int]) -> int:
        """Fill `buffer` from its start and return the number of bytes, 0 after a time-out."""
        with self._in_use(), translated(f"reading samples from endpoint {self._endpoint:#04x}"):
            try:
                return int(self._device.read(self._endpoint, buffer, self._timeout_ms))
            except usb.core.USBTimeoutError:
                return 0

    def cancel(self) -> None:
        """Do nothing: nothing is queued."""
