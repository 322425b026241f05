"""The table of fits: results beside the shots, never inside their files."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass
from typing import Any

from impactd.storage.errors import NotFoundError
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.moment import utc_now


@dataclass(frozen=True)
class Fit:
    """A result of the analysis.

    Attributes
    ----------
    id : int
        [1]
    shot : int or None
        The shot, ``None`` for a joint fit.
    model : str
        E.g. ``kv``.
    calibration : int or None
        The calibration of the load cell that was used.
    job : int or None
        The job that made it.
    result : dict
        As JSON carries it.
    created_utc : str
        When it was written.
    """

    id: int
    shot: int | None
    model: str
    calibration: int | None
    job: int | None
    result: dict[str, Any]
    created_utc: str


class FitTable:
    """The table of fits.

    Parameters
    ----------
    index : Index
        Where it lives.
    """

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
        """Return the next shots that a re-fit has not done.

        Parameters
        ----------
        run : str
            Of the re-fit.
        after : int
            Only numbers above this one.
        limit : int
            At most so many.

        Returns
        -------
        list of int
            Shots, in the order of their numbers.
        """
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
        """Return how many fits a re-fit has written: shots times models, were all well."""
        return self._index.number("SELECT count(*) FROM fits WHERE run = ?", (run,))

    def count_not_in_run(self, run: str) -> int:
        """Return how many shots a re-fit has still to do."""
        return self._index.number(
            "SELECT count(*) FROM shots WHERE NOT EXISTS "
            "(SELECT 1 FROM fits WHERE fits.run = ? AND fits.shot = shots.number)",
            (run,),
        )

    def get(self, number: int) -> Fit:
        """Return one fit.

        Raises
        ------
        NotFoundError
            If there is none of that number.
        """
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

    def latest(
        self,
        *,
        model: str = "kv",
        surface: str | None = None,
        since: str | None = None,
        until: str | None = None,
    ) -> list[Fit]:
        """Return the latest fit of every shot under one model, in the order of the shots.

        Parameters
        ----------
        model : str
            E.g. ``kv``.
        surface : str, optional
            Only shots on this surface.
        since, until : str, optional
            First moment of the shot that counts and first that does not.

        Returns
        -------
        list of Fit
            May be empty.
        """
        rows = self._index.rows(
            "SELECT fits.* FROM fits JOIN shots ON shots.number = fits.shot WHERE fits.id IN "
            "(SELECT max(id) FROM fits WHERE model=? AND shot IS NOT NULL GROUP BY shot) "
            "AND (? IS NULL OR shots.surface = ?) AND (? IS NULL OR shots.started_utc >= ?) "
            "AND (? IS NULL OR shots.started_utc < ?) ORDER BY fits.shot",
            (model, surface, surface, since, since, until, until),
        )
        return [_fit_of(row) for row in rows]

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
