"""The abort epoch at which a request arrived.

::

    bytes arrive ── stamp() ──> request.state.abort_epoch ──> request_drop(accepted=...)
    abort begins ── begin() ──> each stamp is NEVER ──> settle(): what was waiting has been read

What a client has sent lies in the kernel until the event loop reads it, and a busy loop reads late.
So a request that is read after an abort may have been sent before it. From the beginning of an
abort until the loop has read everything that was waiting, requests therefore get a stamp that is
older than every abort: what they ask to move is refused, and never moves after the abort's answer.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import threading
from typing import Annotated

from fastapi import Depends, Request

from impactd.acquisition.abort_epoch import AbortEpoch

ACCEPT_BATCH = 64
"""Most connections that the event loop accepts in one round."""
ACCEPT_QUEUE = 512
"""Connections that the kernel keeps ready for the event loop."""
SETTLE_S = 0.05
"""An idle loop has read everything in a millisecond. An abort's answer waits no longer for one that
is crowded or stuck: until it has read everything, every request that it reads is refused anyway."""
NEVER = 0
"""A stamp older than every abort; the epoch begins at 1."""

# From the kernel's queue to a stamp asyncio takes four rounds: accept, make the transport, watch
# its socket, read it. A full queue is accepted in so many more.
_ROUNDS = 4 + ACCEPT_QUEUE // ACCEPT_BATCH


class Arrivals:
    """Stamps requests, also while an abort is being answered."""

    def __init__(self, epoch: AbortEpoch) -> None:
        self._epoch = epoch
        self._lock = threading.Lock()
        self._unsettled = 0
        self._settling: set[asyncio.Task[None]] = set()  # the loop keeps no task alive by itself
        self._loop: asyncio.AbstractEventLoop | None = None

    def serve_on(self, loop: asyncio.AbstractEventLoop | None) -> None:
        """Set the event loop that reads requests, ``None`` once there is none."""
        self._loop = loop

    def stamp(self) -> int:
        """Return the epoch of a request that is read now."""
        # In this order: an abort says begin() before it advances the epoch.
        epoch = self._epoch.now()
        return NEVER if self._unsettled else epoch

    def begin(self) -> None:
        """Begin an abort, before the epoch advances; `cancel` or one `settle` ends it."""
        with self._lock:
            self._unsettled += 1

    def cancel(self) -> None:
        """End an abort at once: nothing was aborted."""
        with self._lock:
            self._unsettled -= 1

    async def settle(self) -> None:
        """Let the event loop read what arrived before, `SETTLE_S` at most."""
        task = asyncio.ensure_future(self._read_all())
        self._settling.add(task)
        task.add_done_callback(self._settling.discard)
        await asyncio.wait({task}, timeout=SETTLE_S)

    async def _read_all(self) -> None:
        try:
            for _ in range(_ROUNDS):
                await asyncio.sleep(0)
        finally:
            self.cancel()

    def settle_from_thread(self, timeout_s: float = SETTLE_S) -> bool:
        """Do as `settle`, from a thread other than the loop's; return whether it was in time."""
        loop = self._loop
        if loop is None or loop.is_closed():
            self.cancel()
            return True
        settling = self._read_all()
        try:
            future = asyncio.run_coroutine_threadsafe(settling, loop)
        except RuntimeError:  # the loop was closed in this moment: it reads nothing any more
            settling.close()
            self.cancel()
            return True
        try:
            future.result(timeout_s)
        except (TimeoutError, concurrent.futures.CancelledError):
            return False
        return True


async def _accepted(request: Request) -> int:
    stamped: int | None = getattr(request.state, "abort_epoch", None)
    if stamped is not None:
        return stamped
    arrivals: Arrivals = request.app.state.arrivals  # behind a server that stamps nothing
    return arrivals.stamp()


Accepted = Annotated[int, Depends(_accepted)]
"""The abort epoch at which the request arrived."""
