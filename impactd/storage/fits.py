"""The table of fits: results beside the shots, never inside their files."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from typing import Any

from analysis.campaign import Environment
from impactd.storage.errors import NotFoundError
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.materials_json import environment_from_text
from impactd.storage.timestamp import utc_now


@dataclass(frozen=True)
class Fit:
    """A result of the analysis."""

    id: int
    shot: int | None
    """``None`` for a joint fit."""
    model: str
    """E.g. ``kv``."""
    calibration: int | None
    """The calibration of the load cell that was used."""
    job: int | None
    """The job that made it."""
    result: dict[str, Any]
    created_utc: str


@dataclass(frozen=True)
class ShotFit:
    """A fit of one shot, with the columns of its shot that decide whether it counts."""

    fit: Fit
    number: int
    sha256: str
    started_utc: str
    source: str
    clipped: bool
    """Whether the record reaches a limit of the converter or the amplifier."""
    series: int | None
    """The calibration run that its drop belongs to."""
    environment: Environment | None = None


class FitTable:
    """The table of fits."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def add(
        self,
        shot: int | None,
        model: str,
        calibration: int | None,
        result: dict[str, Any],
        *,
        job: int | None = None,
        run: str | None = None,
    ) -> Fit:
        """Write a result; an archive's re-fit names its run, which takes each shot once."""
        number = self._index.write(
            "INSERT INTO fits (shot, model, calibration, job, result, created_utc, run) "
            "VALUES (?, ?, ?, ?, ?, ?, ?)",
            (shot, model, calibration, job, as_text(result), utc_now(), run),
        )
        return self.get(number)

    def not_in_run(self, run: str, *, after: int = 0, limit: int = 1000) -> list[int]:
        """Return the numbers of the next shots that a re-fit has not done, in order."""
        rows = self._index.rows(
            "SELECT number FROM shots WHERE number > ? AND NOT EXISTS "
            "(SELECT 1 FROM fits WHERE fits.run = ? AND fits.shot = shots.number) "
            "ORDER BY number LIMIT ?",
            (after, run, limit),
        )
        return [row["number"] for row in rows]

    def count_in_run(self, run: str) -> int:
        """Return how many shots a re-fit has done."""
        return self._index.number("SELECT count(DISTINCT shot) FROM fits WHERE run = ?", (run,))

    def rows_in_run(self, run: str) -> int:
        """Return how many fits a re-fit has written: one per shot and model, unless some failed."""
        return self._index.number("SELECT count(*) FROM fits WHERE run = ?", (run,))

    def count_not_in_run(self, run: str) -> int:
        """Return how many shots a re-fit has still to do."""
        return self._index.number(
            "SELECT count(*) FROM shots WHERE NOT EXISTS "
            "(SELECT 1 FROM fits WHERE fits.run = ? AND fits.shot = shots.number)",
            (run,),
        )

    def get(self, number: int) -> Fit:
        """Return one fit; raise NotFoundError."""
        row = self._index.row("SELECT * FROM fits WHERE id=?", (number,))
        if row is None:
            raise NotFoundError("fit", number)
        return _fit_of(row)

    def for_shot(self, shot: int) -> list[Fit]:
        """Return the latest fit of each model for a shot, in the order of their models."""
        rows = self._index.rows(
            "SELECT * FROM fits WHERE id IN "
            "(SELECT max(id) FROM fits WHERE shot=? GROUP BY model) ORDER BY model",
            (shot,),
        )
        return [_fit_of(row) for row in rows]

    def last_id(self) -> int:
        """Return the id of the newest fit, 0 before the first."""
        return self._index.number("SELECT max(id) FROM fits")

    def of_shots(self, model: str, *, after: int, last: int) -> list[ShotFit]:
        """Return the fits of single shots under one model, with what the index knows of the shots.

        Only ids above ``after``, up to ``last``, in their order, which is that of writing.
        """
        rows = self._index.rows(
            "SELECT fits.*, shots.sha256, shots.started_utc, shots.source, shots.clipped, "
            "shots.environment, drops.calibration AS series "
            "FROM fits JOIN shots ON shots.number = fits.shot "
            "LEFT JOIN drops ON drops.number = fits.shot "
            "WHERE fits.id > ? AND fits.id <= ? AND fits.model = ? ORDER BY fits.id",
            (after, last, model),
        )
        return [
            ShotFit(
                fit=_fit_of(row),
                number=row["shot"],
                sha256=row["sha256"],
                started_utc=row["started_utc"],
                source=row["source"],
                clipped=bool(row["clipped"]),
                series=row["series"],
                environment=environment_from_text(row["environment"]),
            )
            for row in rows
        ]

    def noise_of_newest(self, limit: int) -> list[tuple[int, str, float]]:
        """Return number, start and noise before the trigger [V rms] of the newest own shots.

        Oldest first; shots whose fits do not state the noise are left out.
        """
        rows = self._index.rows(
            "SELECT number, started_utc, (SELECT json_extract(result, '$.noise_rms') FROM fits "
            "WHERE shot = number ORDER BY id DESC LIMIT 1) AS noise FROM "
            "(SELECT * FROM shots WHERE source = 'drop' ORDER BY number DESC LIMIT ?) "
            "ORDER BY number",
            (limit,),
        )
        return [
            (row["number"], row["started_utc"], row["noise"])
            for row in rows
            if row["noise"] is not None
        ]

    def of_job(self, job: int) -> list[Fit]:
        """Return the fits that a job wrote."""
        rows = self._index.rows("SELECT * FROM fits WHERE job=? ORDER BY id", (job,))
        return [_fit_of(row) for row in rows]


def _fit_of(row: sqlite3.Row) -> Fit:
    return Fit(
        id=row["id"],
        shot=row["shot"],
        model=row["model"],
        calibration=row["calibration"],
        job=row["job"],
        result=from_text(row["result"]),
        created_utc=row["created_utc"],
    )
