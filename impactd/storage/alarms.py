"""The table of alarms: what went wrong and has to be seen by somebody, over restarts."""

from __future__ import annotations

from dataclasses import dataclass

from impactd.storage.errors import NotFoundError
from impactd.storage.index import Index
from impactd.storage.timestamp import utc_now


@dataclass(frozen=True)
class Alarm:
    """Something that went wrong."""

    id: int
    kind: str
    """The event that raised it, e.g. ``rig.fault``."""
    sentence: str
    remedy: str
    """May be empty."""
    times: int
    """How often it happened since it was first raised: a flapping device is one alarm."""
    first_utc: str
    last_utc: str
    acknowledged_utc: str | None
    """``None`` while it is open."""
    acknowledged_by: str | None


class AlarmTable:
    """The table of alarms; no row is ever deleted."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def raise_alarm(self, kind: str, sentence: str, remedy: str) -> Alarm:
        """Write an alarm; an open one with the same words is counted once more."""
        now = utc_now()
        with self._index.transaction():
            row = self._index.row(
                "SELECT id FROM alarms WHERE acknowledged_utc IS NULL AND kind=? AND sentence=?",
                (kind, sentence),
            )
            if row is not None:
                self._index.write(
                    "UPDATE alarms SET times=times+1, last_utc=?, remedy=? WHERE id=?",
                    (now, remedy, row["id"]),
                )
                return self.get(row["id"])
            number = self._index.write(
                "INSERT INTO alarms (kind, sentence, remedy, times, first_utc, last_utc) "
                "VALUES (?, ?, ?, 1, ?, ?)",
                (kind, sentence, remedy, now, now),
            )
        return self.get(number)

    def acknowledge(self, number: int, by: str) -> Alarm:
        """Write who has seen an alarm; the first acknowledgement counts. Raise NotFoundError."""
        self._index.write(
            "UPDATE alarms SET acknowledged_utc=?, acknowledged_by=? "
            "WHERE id=? AND acknowledged_utc IS NULL",
            (utc_now(), by, number),
        )
        return self.get(number)

    def get(self, number: int) -> Alarm:
        """Return one alarm; raise NotFoundError."""
        row = self._index.row("SELECT * FROM alarms WHERE id=?", (number,))
        if row is None:
            raise NotFoundError("alarm", number)
        return Alarm(*tuple(row))

    def open(self) -> list[Alarm]:
        """Return the alarms that nobody has acknowledged, newest first."""
        rows = self._index.rows(
            "SELECT * FROM alarms WHERE acknowledged_utc IS NULL ORDER BY last_utc DESC, id DESC"
        )
        return [Alarm(*tuple(row)) for row in rows]

    def acknowledged(self, limit: int = 50) -> list[Alarm]:
        """Return the alarms that were acknowledged last, newest first."""
        rows = self._index.rows(
            "SELECT * FROM alarms WHERE acknowledged_utc IS NOT NULL "
            "ORDER BY acknowledged_utc DESC, id DESC LIMIT ?",
            (limit,),
        )
        return [Alarm(*tuple(row)) for row in rows]
