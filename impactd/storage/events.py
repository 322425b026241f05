"""The table of events: what clients are told, numbered so that a lost connection loses nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from impactd.storage.index import Index, as_text, from_text
from impactd.storage.timestamp import utc_now

KEPT_EVENTS = 100_000


@dataclass(frozen=True)
class Event:
    """Something that happened."""

    id: int
    """Grows with time; SSE clients send the last one they saw."""
    utc: str
    kind: str
    """E.g. ``drop.stored``."""
    data: dict[str, Any]


class EventTable:
    """The table of events; the last ``KEPT_EVENTS`` are kept."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def append(self, kind: str, data: dict[str, Any]) -> Event:
        """Write an event, durably."""
        utc = utc_now()
        with self._index.transaction():
            number = self._index.write(
                "INSERT INTO events (utc, kind, data) VALUES (?, ?, ?)", (utc, kind, as_text(data))
            )
            if number % 1000 == 0:
                self._index.write("DELETE FROM events WHERE id <= ?", (number - KEPT_EVENTS,))
        return Event(number, utc, kind, data)

    def since(self, number: int, limit: int = 1000) -> list[Event]:
        """Return the events after one, oldest first."""
        rows = self._index.rows(
            "SELECT * FROM events WHERE id > ? ORDER BY id LIMIT ?", (number, limit)
        )
        return [Event(row["id"], row["utc"], row["kind"], from_text(row["data"])) for row in rows]

    def latest(
        self, *, limit: int, before: int | None = None, kinds: Sequence[str] = ()
    ) -> list[Event]:
        """Return events, newest first: those below ``before``, of ``kinds`` if any are named."""
        marks = ", ".join("?" * len(kinds))
        chosen = f"kind IN ({marks})" if kinds else "1"
        rows = self._index.rows(
            f"SELECT * FROM events WHERE {chosen} AND (? IS NULL OR id < ?) "  # noqa: S608 - marks
            "ORDER BY id DESC LIMIT ?",
            (*kinds, before, before, limit),
        )
        return [Event(row["id"], row["utc"], row["kind"], from_text(row["data"])) for row in rows]

    def last_id(self) -> int:
        """Return the number of the newest event, 0 before the first."""
        return self._index.number("SELECT max(id) FROM events")
