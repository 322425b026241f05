"""Limits of number and time for connections, and which one is closed first.

Nobody needs a token to connect. So that a stranger who holds connections keeps nobody out, least
of all an abort, a new connection always gets in, and the one that is worth least is closed for it.
"""

from __future__ import annotations

import asyncio
import resource
import time
from collections import Counter
from typing import Protocol

import structlog

_log = structlog.get_logger("impactd.http")

# pyserial waits with select(), which knows no descriptor from 1024 on; a relay board that is opened
# again must get a smaller one, however many connections there are.
_SELECT_LIMIT = 1024
# Database: three for each of some 60 threads (180). Devices, workers, files, the abort door: 76.
_RESERVED = 256
# A batch that is accepted closes its victims three rounds of the event loop later, with two more
# batches accepted meanwhile (3 x 64 of `arrivals.ACCEPT_BATCH`).
_IN_TRANSIT = 192
_MOST = 512
_FEWEST = 16
# A header and a body of 64 KiB take 5 s at 100 kbit/s; twice that.
RECEIVE_LIMIT_S = 10.0
LEAST_BYTES_PER_S = 250e3
"""2 Mbit/s, a poor radio link: what arrives as fast does not count as slow, and 32 MiB take two
minutes at most."""
_SWEEP_EVERY_S = 1.0
_LOG_EVERY_S = 60.0

UNFINISHED_HEADER, UNFINISHED_BODY, IDLE, ANSWERS_STRANGER, ANSWERS_CALLER = range(5)
"""What a connection is doing, the one that makes room first first."""


class Limited(Protocol):
    """The part of a connection that its limits need."""

    receiving_since_s: float | None

    def rank(self) -> int | None:
        """Return what it is doing; ``None`` for an abort, which is never closed."""

    def close_now(self) -> None:
        """Close without an answer."""


def raise_descriptor_limit() -> None:
    """Allow this process as many descriptors as the system lets it have."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != hard:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def descriptor_limit() -> int:
    """Return how many descriptors this process may have now."""
    return resource.getrlimit(resource.RLIMIT_NOFILE)[0]


def most_connections(descriptors: int) -> int:
    """Return how many connections fit beside everything else that needs a descriptor.

    ``descriptors`` is what the process may have; -1 is without limit.
    """
    unlimited = descriptors == resource.RLIM_INFINITY
    limit = _SELECT_LIMIT if unlimited else min(descriptors, _SELECT_LIMIT)
    return max(_FEWEST, min(_MOST, limit - _RESERVED - _IN_TRANSIT))


class Connections:
    """All connections of one server; used in the event loop's thread only.

    At most ``most`` at once. ``receive_limit_s`` counts from the first byte of a request to its
    last, and from a connection to its first request; each byte adds its share of
    `LEAST_BYTES_PER_S`.
    """

    def __init__(self, most: int, receive_limit_s: float = RECEIVE_LIMIT_S) -> None:
        self._most = most
        self._receive_limit_s = receive_limit_s
        self._open: dict[Limited, None] = {}  # oldest first
        self._closed: Counter[str] = Counter()
        self._logged_s = float("-inf")
        self._sweeping = False

    def add(self, connection: Limited, loop: asyncio.AbstractEventLoop) -> None:
        """Add a new connection; another one is closed for it when there are too many."""
        if len(self._open) >= self._most:
            self._make_room()
        self._open[connection] = None
        if not self._sweeping:
            self._sweeping = True
            loop.call_later(_SWEEP_EVERY_S, self._sweep, loop)

    def discard(self, connection: Limited) -> None:
        """Remove a connection that has ended."""
        self._open.pop(connection, None)

    def count(self, what: str) -> None:
        """Count an event that is logged once a minute."""
        self._closed[what] += 1

    def _make_room(self) -> None:
        victim: Limited | None = None
        lowest = ANSWERS_CALLER + 1
        for connection in self._open:
            rank = connection.rank()
            if rank is not None and rank < lowest:
                victim, lowest = connection, rank
                if rank == UNFINISHED_HEADER:
                    break
        if victim is not None:
            self._close(victim, "for_room")

    def _close(self, connection: Limited, why: str) -> None:
        self.discard(connection)
        self.count(why)
        connection.close_now()

    def _sweep(self, loop: asyncio.AbstractEventLoop) -> None:
        now_s = time.monotonic()
        for connection in list(self._open):
            since_s = connection.receiving_since_s
            if since_s is not None and now_s - since_s > self._receive_limit_s:
                self._close(connection, "too_slow")
        if self._closed and now_s - self._logged_s >= _LOG_EVERY_S:
            self._logged_s = now_s
            _log.warning("connections closed", open=len(self._open), **self._closed)
            self._closed.clear()
        self._sweeping = bool(self._open or self._closed)
        if self._sweeping:
            loop.call_later(_SWEEP_EVERY_S, self._sweep, loop)
