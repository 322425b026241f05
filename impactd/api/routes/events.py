"""Events: what happens, as server-sent events."""

from __future__ import annotations

from collections.abc import AsyncIterable
from typing import Annotated

from fastapi import APIRouter, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent

from impactd.api.finite import without_nan
from impactd.api.security import TheDaemon

router = APIRouter(prefix="/v1/events", tags=["rig"])
_LARGEST = 2**53 - 1


@router.get("", response_class=EventSourceResponse)
async def events(
    daemon: TheDaemon,
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
    yield ServerSentEvent(comment="impactd", retry=2000)
    async for event in daemon.bus.listen(seen):
        yield ServerSentEvent(
            id=str(event.id),
            event=event.kind,
            data=without_nan({"utc": event.utc, "kind": event.kind, **event.data}),
        )
