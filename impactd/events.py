"""The event bus: events go from threads of the daemon to the listeners of the API.

Every event is first written to the archive's event table and only then announced, so that the
table is the queue: a listener that was away asks for what came after the last number it saw, and
a slow listener holds nobody up.

Publishers are threads (acquisition, jobs); listeners are coroutines of the API.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator
from typing import Any

import anyio

from impactd.storage.events import Event, EventTable

_POLL_S = 5.0
"""Longest wait without looking: other processes (``impactd import``) write events too."""
_BATCH = 200


class EventBus:
    """The event table with a signal for new events."""

    def __init__(self, table: EventTable) -> None:
        self._table = table
        self._lock = threading.Lock()
        self._bells: set[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = set()
        self._closed = False

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        """Write an event, e.g. ``drop.stored``, and wake the listeners; from any thread."""
        self._table.append(kind, data)
        self._ring()

    def close(self) -> None:
        """End every listener, so that a server can shut down."""
        self._closed = True
        self._ring()

    @property
    def closed(self) -> bool:
        """Return whether `close` was called."""
        return self._closed

    async def last_id(self) -> int:
        """Return the number of the newest event."""
        found: int = await self._in_thread(self._table.last_id)
        return found

    async def listen(self, after: int) -> AsyncIterator[Event]:
        """Yield the events after a number as they come, forever or until `close`.

        Yields
        ------
        Event
            In the order of their numbers, none twice, none left out.
        """
        bell = asyncio.Event()
        entry = (asyncio.get_running_loop(), bell)
        with self._lock:
            self._bells.add(entry)
        try:
            last = after
            while not self._closed:
                bell.clear()
                batch = await self._in_thread(self._table.since, last, _BATCH)
                for event in batch:
                    yield event
                    last = event.id
                if not batch:
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(bell.wait(), _POLL_S)
        finally:
            with self._lock:
                self._bells.discard(entry)

    @staticmethod
    async def _in_thread(function: Any, *arguments: Any) -> Any:
        return await anyio.to_thread.run_sync(function, *arguments)

    def _ring(self) -> None:
        with self._lock:
            bells = list(self._bells)
        for loop, bell in bells:
            with contextlib.suppress(RuntimeError):  # the loop ended between copy and call
                loop.call_soon_threadsafe(bell.set)
