"""Events: what happens, as server-sent events."""

from __future__ import annotations

import time
from collections.abc import AsyncIterable
from typing import Annotated

import anyio
from fastapi import APIRouter, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent

from impactd.api.finite import without_nan
from impactd.api.security import TheCaller, TheDaemon

router = APIRouter(prefix="/v1/events", tags=["rig"])
_LARGEST = 2**53 - 1
# A stream lives for days: the token behind it is looked at again while it tells things.
_STILL_VALID_EVERY_S = 2.0


@router.get("", response_class=EventSourceResponse)
async def events(
    daemon: TheDaemon,
    caller: TheCaller,
    last_event_id: Annotated[
        int | None,
        Header(
            alias="Last-Event-ID", ge=0, le=_LARGEST, description="Sent by a client that returns."
        ),
    ] = None,
    after: Annotated[
        int | None, Query(ge=0, le=_LARGEST, description="As Last-Event-ID, for a first look back.")
    ] = None,
) -> AsyncIterable[ServerSentEvent]:
    """Stream events as they come, from `Last-Event-ID` on when it is given; `: ping` when idle.

    Yields
    ------
    ServerSentEvent
        With the event's number as id, so that a client that returns misses nothing.
    """
    seen = last_event_id if last_event_id is not None else after
    looked_s = time.monotonic()
    yield ServerSentEvent(comment="impactd", retry=2000)
    async for event in daemon.bus.listen(seen):
        if time.monotonic() - looked_s >= _STILL_VALID_EVERY_S:
            looked_s = time.monotonic()
            tokens = daemon.archive.tokens
            if not await anyio.to_thread.run_sync(tokens.valid, caller.token_id or 0):
                return
        yield ServerSentEvent(
            id=str(event.id),
            event=event.kind,
            data=without_nan({"utc": event.utc, "kind": event.kind, **event.data}),
        )
