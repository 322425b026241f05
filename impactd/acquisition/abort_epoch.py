"""The abort epoch: a counter that every abort advances and every movement is checked against.

::

    request received ── now() ──> its epoch travels with it ──> compared just before the valve opens
    abort            ── advance() ──> everything accepted before is void, wherever it waits

A request to move carries the epoch at which it was received. The valve opens only for the present
epoch, and the comparison is made under the lock that an abort takes too. So nothing that is older
than an abort can move after it: not a drop, not the next drop of a series, not a request that still
waits for the disk.
"""

from __future__ import annotations

import threading


class AbortEpoch:
    """A counter that only grows. Thread safe.

    Notes
    -----
    It starts at 1 with each daemon, so 0 is older than everything: the epoch of a request whose
    time of arrival is not known.
    """

    def __init__(self) -> None:
        self._value = 1
        self._lock = threading.Lock()

    def now(self) -> int:
        """Return the present epoch."""
        return self._value

    def advance(self) -> int:
        """Begin the next epoch and return it; everything accepted before is void."""
        with self._lock:
            self._value += 1
            return self._value

    def is_present(self, epoch: int) -> bool:
        """Return whether nothing was aborted since an epoch was read."""
        return epoch == self._value
