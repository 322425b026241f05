"""Events: what happens, as server-sent events."""

from __future__ import annotations

import time
from collections.abc import AsyncIterable
from typing import Annotated

import anyio
from fastapi import APIRouter, Depends, Header, Query, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent

from impactd.api.finite import without_nan
from impactd.api.security import TheCaller, TheDaemon

router = APIRouter(prefix="/v1/events", tags=["rig"])
_LARGEST = 2**53 - 1
# A stream lives for days: the token behind it is looked at again while it tells things.
_STILL_VALID_EVERY_S = 2.0


_PLACE = "Last-Event-ID"
_LastEventId = Annotated[
    int | None,
    Header(alias=_PLACE, ge=0, le=_LARGEST, description="Sent by a client that returns."),
]
_After = Annotated[
    int | None, Query(ge=0, le=_LARGEST, description="As Last-Event-ID, for a first look back.")
]


async def _place(
    response: Response,
    daemon: TheDaemon,
    last_event_id: _LastEventId = None,
    after: _After = None,
) -> int:
    """Return the number of the event after which a stream begins.

    The answer says it in its own `Last-Event-ID`: a client that loses its connection before the
    first event goes on from there.
    """
    place = last_event_id if last_event_id is not None else after
    if place is None:
        place = await daemon.bus.last_id()
    response.headers[_PLACE] = str(place)
    return place


@router.get("", response_class=EventSourceResponse)
async def events(
    daemon: TheDaemon, caller: TheCaller, place: Annotated[int, Depends(_place)]
) -> AsyncIterable[ServerSentEvent]:
    """Stream events as they come, from `Last-Event-ID` on when it is given; `: ping` when idle.

    Yields
    ------
    ServerSentEvent
        With the event's number as id, so that a client that returns misses nothing.
    """
    looked_s = time.monotonic()
    yield ServerSentEvent(comment="impactd", retry=2000)
    async for event in daemon.bus.listen(place):
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
