"""The abort epoch: a counter that every abort advances and every movement is checked against.

::

    request received ── now() ──> its epoch travels with it ──> compared just before the valve opens
    abort            ── advance() ──> everything accepted before is void, wherever it waits

A request to move carries the epoch at which it was received. The valve opens only for the present
epoch, and an abort advances the epoch before it switches the vacuum on. So nothing that is older
than an abort can move after it: not a drop, not the next drop of a series, not a request that still
waits for the disk.
"""

from __future__ import annotations

import threading

from impactd.acquisition.errors import RequestAbortedError
from impactd.storage.timestamp import utc_now


class AbortEpoch:
    """A counter that only grows. Thread safe.

    It starts at 1 with each daemon, so 0 is older than everything: the epoch of a request whose
    time of arrival is not known.
    """

    def __init__(self) -> None:
        self._value = 1
        self._closed = False
        self._last = RequestAbortedError("nobody", "no time")
        self._lock = threading.Lock()

    def refusal(self) -> RequestAbortedError:
        """Return why what was accepted before the last abort is void."""
        return self._last

    def now(self) -> int:
        """Return the present epoch."""
        return self._value

    def advance(self, by: str) -> int:
        """Begin the next epoch and return it; everything accepted before is void."""
        with self._lock:
            self._value += 1
            self._last = RequestAbortedError(by, utc_now())
            return self._value

    def close(self, by: str) -> None:
        """Make everything void until `open`: the daemon ends."""
        with self._lock:
            self._closed = True
        self.advance(by)

    def open(self) -> None:
        """Let new requests be valid again; what was accepted before `close` stays void."""
        with self._lock:
            self._closed = False

    def is_present(self, epoch: int) -> bool:
        """Return whether nothing was aborted since an epoch was read."""
        return epoch == self._value and not self._closed
