"""The table of calibration runs of the load cell, one per slot of the timer."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from impactd.storage.errors import ArchiveError, IdempotencyConflictError, NotFoundError
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.problem import Problem
from impactd.storage.publish import publish
from impactd.storage.request_key import bare_key
from impactd.storage.sealed import seal, unseal
from impactd.storage.timestamp import utc_now

DROPS = "drops"
STATIC_WEIGHTS = "static_weights"
"""Kinds of calibrations."""

_SELECT = (
    "SELECT calibrations.*, (SELECT json_group_array(number) FROM "
    "(SELECT number FROM drops WHERE calibration=calibrations.number ORDER BY number)) AS drops "
    "FROM calibrations "
)


@dataclass(frozen=True)
class Calibration:
    """A calibration run."""

    number: int
    slot: str | None
    """The timer slot it belongs to: the same slot never runs twice."""
    plan: list[dict[str, Any]]
    """The series: sphere, surface, drop_height_m, repeats."""
    owner: str
    """Name of the token that asked for it."""
    state: str
    """``requested``, ``running``, ``fitting``, ``done`` or ``failed``."""
    drops: tuple[int, ...]
    """Numbers of its drops, in order."""
    result: dict[str, Any] | None
    """The joint fit, once done."""
    problem: Problem | None
    requested_utc: str
    finished_utc: str | None
    valid_until_utc: str | None

    @property
    def kind(self) -> str:
        """Return ``drops``, or ``static_weights`` for a line through weights."""
        return str(self.plan[0].get("method", DROPS)) if self.plan else DROPS


class CalibrationTable:
    """The table of calibrations.

    Results are kept in ``directory`` too, one JSON file each, so that they outlive a lost index.
    """

    def __init__(self, index: Index, directory: Path) -> None:
        self._index = index
        self._directory = directory

    def begin(
        self, slot: str | None, plan: list[dict[str, Any]], owner: str
    ) -> tuple[Calibration, bool]:
        """Open a calibration, durably; a slot that was used before gives the old one.

        ``slot`` is the timer's slot, or a client's idempotency key with the namespace of
        `request_key`. The second value says whether it was created now. Raises
        IdempotencyConflictError if the slot was used with another plan.
        """
        with self._index.transaction():
            row = self._by_slot(slot) if slot else None
            if row is not None:
                if row["plan"] != as_text(plan):
                    raise IdempotencyConflictError(str(slot), row["number"])
                return _calibration_of(row), False
            number = self._index.write(
                "INSERT INTO calibrations (slot, plan, owner, state, requested_utc) "
                "VALUES (?, ?, ?, 'requested', ?)",
                (slot, as_text(plan), owner, utc_now()),
            )
            return self.get(number), True

    def _by_slot(self, slot: str) -> sqlite3.Row | None:
        row = self._index.row(_SELECT + "WHERE slot=?", (slot,))
        bare = bare_key(slot, has_kind=True)
        if row is not None or bare is None:
            return row
        owned = "WHERE slot=? AND owner=(SELECT name FROM tokens WHERE id=?)"
        return self._index.row(_SELECT + owned, (bare.key, bare.token))

    def set_state(self, number: int, state: str) -> Calibration:
        """Write the next state of a calibration (``running``, ``fitting``)."""
        return self._update(number, "state=?", (state,))

    def attach(self, number: int, drop: int) -> None:
        """Write that a drop belongs to a calibration, as `begin_drop(calibration=...)` does."""
        self._index.write("UPDATE drops SET calibration=? WHERE number=?", (number, drop))

    def finish(self, number: int, result: dict[str, Any], valid_until_utc: str) -> Calibration:
        """Write the result of a calibration, into the index and into a file beside it."""
        with self._index.transaction():
            done = self._update(
                number,
                "state='done', result=?, problem=NULL, valid_until_utc=?, finished_utc=?",
                (as_text(result), valid_until_utc, utc_now()),
            )
            path = self._directory / f"{number:06d}.json"
            publish(path, seal(asdict(done)), replace=True)
        return done

    def restore(self) -> tuple[int, list[str]]:
        """Take the results that the index lacks from their files.

        Return how many were taken in, and which files could not be, and why.
        """
        taken, damaged = 0, []
        for path in self._paths():
            try:
                kept = unseal(path)
            except ArchiveError as error:
                damaged.append(str(error))
                continue
            row = self._index.row(
                "SELECT state FROM calibrations WHERE number=?", (kept["number"],)
            )
            if row is not None and row["state"] == "done":
                continue
            self._index.write(
                "INSERT OR REPLACE INTO calibrations VALUES (?, ?, ?, ?, 'done', ?, NULL, ?, ?, ?)",
                (
                    kept["number"],
                    kept["slot"],
                    as_text(kept["plan"]),
                    kept["owner"],
                    as_text(kept["result"]),
                    kept["requested_utc"],
                    kept["finished_utc"],
                    kept["valid_until_utc"],
                ),
            )
            taken += 1
        return taken, damaged

    def findings(self) -> Iterator[tuple[str, str | None]]:
        """Yield the name of each file and what is wrong with it, ``None`` where it is sound."""
        for path in self._paths():
            try:
                kept = unseal(path)
                same = self.get(kept["number"]).result == kept["result"]
            except (ArchiveError, KeyError, TypeError) as error:
                yield str(path), str(error)
            else:
                yield str(path), None if same else "it is not what the index holds."

    def _paths(self) -> list[Path]:
        return sorted(self._directory.glob("*.json"))

    def fail(self, number: int, problem: Problem) -> Calibration:
        """Write why a calibration failed."""
        return self._update(
            number,
            "state='failed', problem=?, finished_utc=?",
            (problem.to_text(), utc_now()),
        )

    def current(self) -> Calibration | None:
        """Return the last one that was done, valid or overdue; ``None`` before the first.

        Weights give no crystal: a static calibration never takes the place of one with drops.
        """
        row = self._index.row(
            _SELECT + "WHERE state='done' AND coalesce(json_extract(result, '$.method'), ?)=? "
            "ORDER BY number DESC LIMIT 1",
            (DROPS, DROPS),
        )
        return None if row is None else _calibration_of(row)

    def get(self, number: int) -> Calibration:
        """Return one calibration; raise NotFoundError."""
        row = self._index.row(_SELECT + "WHERE number=?", (number,))
        if row is None:
            raise NotFoundError("calibration", number)
        return _calibration_of(row)

    def by_slot(self, slot: str) -> Calibration | None:
        """Return the calibration of a slot, ``None`` when the slot was never used."""
        row = self._by_slot(slot)
        return None if row is None else _calibration_of(row)

    def list(self, *, limit: int = 50, before: int | None = None) -> list[Calibration]:
        """Return calibrations, newest first."""
        rows = self._index.rows(
            _SELECT + "WHERE ? IS NULL OR number < ? ORDER BY number DESC LIMIT ?",
            (before, before, limit),
        )
        return [_calibration_of(row) for row in rows]

    def _update(self, number: int, what: str, values: tuple[object, ...]) -> Calibration:
        with self._index.transaction():
            self.get(number)
            self._index.write(
                f"UPDATE calibrations SET {what} WHERE number=?",  # noqa: S608 - texts of this file
                (*values, number),
            )
            return self.get(number)


def _calibration_of(row: sqlite3.Row) -> Calibration:
    return Calibration(
        number=row["number"],
        slot=row["slot"],
        plan=from_text(row["plan"]),
        owner=row["owner"],
        state=row["state"],
        drops=tuple(from_text(row["drops"])),
        result=None if row["result"] is None else from_text(row["result"]),
        problem=Problem.from_text(row["problem"]),
        requested_utc=row["requested_utc"],
        finished_utc=row["finished_utc"],
        valid_until_utc=row["valid_until_utc"],
    )
