"""The table of shots: one row per immutable file, enough to list, filter and check it."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from analysis.campaign import Environment
from impactd.storage.errors import NotFoundError
from impactd.storage.index import Index
from impactd.storage.materials_json import environment_from_text, environment_to_text


@dataclass(frozen=True)
class Shot:
    """The index's row of a shot file."""

    number: int
    """The drop's number, or the next free one for an import."""
    file: str
    """Path below the archive's directory."""
    sha256: str
    """Hash of the whole file, checked whenever it is read."""
    size_bytes: int
    source: str
    """``drop`` or ``import``."""
    origin: str
    """For an import, file and hash of the samples; the same samples are not imported twice."""
    started_utc: str
    stored_utc: str
    """When it was durable."""
    sphere: str | None
    """``None`` = unknown, as ``surface`` (recordings made elsewhere)."""
    surface: str | None
    drop_height_m: float | None
    operator: str
    """Empty when unknown."""
    quantity: str
    """``voltage``, ``force_N`` or ``acceleration_m_per_s2``."""
    sample_rate_hz: float
    """Calibrated rate. [Hz]"""
    samples: int
    trigger_index: int
    peak: float
    """Sample farthest from the baseline, baseline removed. [V, N or m/s^2]"""
    clipped: bool
    """Whether the record reaches a limit of the converter or the amplifier."""
    environment: Environment | None = None


_SEARCH = (
    "instr(lower(number || ' ' || ifnull(sphere, '') || ' ' || ifnull(surface, '') || ' ' || "
    "operator || ' ' || origin), lower(?)) > 0"
)


class ShotTable:
    """The table of shots."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def add(self, shot: Shot) -> None:
        """Write a row."""
        *named, _ = (getattr(shot, field.name) for field in fields(shot))
        values = (*named, environment_to_text(shot.environment))
        marks = ", ".join("?" * len(values))
        self._index.write(f"INSERT INTO shots VALUES ({marks})", values)  # noqa: S608 - only marks

    def get(self, number: int) -> Shot:
        """Return one row; raise NotFoundError."""
        row = self._index.row("SELECT * FROM shots WHERE number=?", (number,))
        if row is None:
            raise NotFoundError("shot", number)
        return _shot_of(tuple(row))

    def by_origin(self, origin: str) -> Shot | None:
        """Return the shot that was imported from there, ``None`` when none was."""
        row = self._index.row("SELECT * FROM shots WHERE origin=?", (origin,))
        return None if row is None else _shot_of(tuple(row))

    def find(
        self,
        *,
        sphere: str | None = None,
        surface: str | None = None,
        since: str | None = None,
        until: str | None = None,
        search: str | None = None,
        limit: int = 50,
        before: int | None = None,
    ) -> list[Shot]:
        """Return shots, newest first, that match all that is given.

        Parameters
        ----------
        since, until : str, optional
            First timestamp that counts and first that does not, in the form of `timestamp.utc_now`.
        search : str, optional
            A shot's number, or a part of sphere, surface, operator or origin; case does not count.
        before : int, optional
            Only numbers below this one (the next page).
        """
        conditions = {
            "sphere = ?": sphere,
            "surface = ?": surface,
            "started_utc >= ?": since,
            "started_utc < ?": until,
            "number < ?": before,
        }
        given = {text: value for text, value in conditions.items() if value is not None}
        if search is not None:
            given[_SEARCH] = search
        where = "WHERE " + " AND ".join(given) if given else ""
        rows = self._index.rows(
            f"SELECT * FROM shots {where} ORDER BY number DESC LIMIT ?",  # noqa: S608 - fixed texts
            (*given.values(), limit),
        )
        return [_shot_of(tuple(row)) for row in rows]


def _shot_of(values: tuple[Any, ...]) -> Shot:
    *known, clipped, environment = values
    return Shot(*(*known, bool(clipped), environment_from_text(environment)))
