"""The events of a rig, and how a stream of them survives a lost line."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import httpx2

PATH = "/v1/events"
_SILENCE_S = 60.0
"""The daemon says something every 15 s; four of these missed are a dead line."""
_AGAIN_AFTER_S = 2.0


@dataclass(frozen=True)
class Event:
    """Something that happened.

    Attributes
    ----------
    id : int
        Rises; a listener that returns goes on behind the last one it saw.
    kind : str
        For example ``drop.stored``.
    utc : str
        When.
    data : mapping
        What belongs to the kind.
    """

    id: int
    kind: str
    utc: str
    data: Mapping[str, Any]


class Position:
    """Where in the stream of events a listener is, over all its connections.

    Parameters
    ----------
    after : int or None
        Number of the last event that was seen; ``None`` begins with the next one.
    """

    def __init__(self, after: int | None) -> None:
        self.last = after
        self.connected = False  # ever
        self.again_after_s = _AGAIN_AFTER_S

    def options(self, timeout_s: float) -> dict[str, Any]:
        """Return the request that continues after the last event."""
        headers = {"Accept": "text/event-stream"}
        if self.last is not None:
            headers["Last-Event-ID"] = str(self.last)
        timeout = httpx2.Timeout(timeout_s, read=_SILENCE_S)
        return {"method": "GET", "url": PATH, "headers": headers, "timeout": timeout}

    def begin(self, answer: httpx2.Response) -> None:
        """Note where a stream begins: the line may break before the first event."""
        self.connected = True
        place = answer.headers.get("Last-Event-ID")
        if place is not None:
            self.last = int(place)

    def take(self, frame: httpx2.ServerSentEvent) -> Event | None:
        """Return the event of a frame, ``None`` for one that tells none."""
        if frame.retry is not None:
            self.again_after_s = frame.retry / 1000
        if frame.id:
            self.last = int(frame.id)
        if not frame.data:
            return None
        data = frame.json()
        assert isinstance(data, dict), "events are JSON objects"
        assert self.last is not None, "every event has a number"
        utc = str(data.pop("utc"))
        return Event(self.last, frame.event, utc, data)
