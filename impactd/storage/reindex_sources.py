"""The first sources of a rebuilt index: the journal, and the old index for what it lacks."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from impactd.storage import checksums, journal_rows
from impactd.storage.journal import JOURNAL_NAME, Position
from impactd.storage.journal_check import Lines
from impactd.storage.journaling import position

# ruff: noqa: S608 - nothing here but the names of our own tables

_IN_NO_FILE = (
    "fits, tokens, jobs, events, alarms, comparisons, the drops that left no shot with their keys, "
    "and the rebound heights"
)


def take_from_journal_and_index(
    connection: sqlite3.Connection, path: Path
) -> tuple[list[str], list[str]]:
    """Fill an empty index; the caller holds the transaction.

    A whole journal is enough. Where it is damaged, the old index at ``path`` fills the holes, if
    it is there: it holds what was committed up to its position, so lines up to there go before its
    rows, later ones behind. Return what is damaged and could be mended, and what is lost.
    """
    journal = path.with_name(JOURNAL_NAME)
    lines = Lines(journal)
    if journal.exists():
        for _ in lines.read():
            pass
    old = OldIndex(path)
    ours = old.position is not None and lines.id in (None, old.position.journal)
    known_n = old.position.n if old.position is not None and ours else 0
    refused: list[str] = []
    if lines.whole() and known_n <= lines.n:
        _apply(connection, journal, 1, lines.n, refused)
        return [], refused
    _apply(connection, journal, 1, known_n, refused)
    old.copy_into(connection)
    _apply(connection, journal, known_n + 1, lines.n, refused)
    damaged, lost = _told(lines, old, known_n)
    return damaged, refused + old.lacks(connection) + lost


def _apply(
    connection: sqlite3.Connection, journal: Path, first: int, last: int, refused: list[str]
) -> None:
    if not journal.exists() or first > last:
        return
    for n, rows in Lines(journal).read():
        for row in rows if first <= n <= last else ():
            try:
                journal_rows.apply(connection, [row])
            except sqlite3.IntegrityError as error:
                refused.append(f"A row of {row[0]} in transaction {n} of the journal: {error}.")


class OldIndex:
    """An index as far as it can be read; it may be damaged or absent.

    ``position`` says how far of its journal it is, ``None`` where that cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.position: Position | None = None
        self._changed: list[tuple[str, int]] = []
        self._cut_short: list[str] = []
        self._refused: list[str] = []
        if path.exists():
            with suppress(sqlite3.Error, UnicodeDecodeError), closing(self._open()) as connection:
                if not _changed(connection, journal_rows.POSITION):
                    self.position = position(connection)

    def _open(self) -> sqlite3.Connection:
        connection = sqlite3.connect(self._path)
        connection.row_factory = sqlite3.Row
        return connection

    def copy_into(self, connection: sqlite3.Connection) -> None:
        """Copy every row that is what was written; the others are remembered."""
        if not self._path.exists():
            self._cut_short += journal_rows.TABLES
            return
        for table in journal_rows.TABLES:
            for row in self._rows(table):
                try:
                    journal_rows.put(connection, table, row)
                except sqlite3.Error as error:
                    self._refused.append(f"A row of {table} of the old index: {error}.")

    def _rows(self, table: str) -> Iterator[dict[str, Any]]:
        try:
            with closing(self._open()) as connection:
                changed = _changed(connection, table)
                self._changed += [(table, row) for row in sorted(changed)]
                found = connection.execute(f"SELECT *, rowid AS row_of_table FROM {table}")
                for row in found:  # not at once: what came before a broken page is kept
                    if row["row_of_table"] not in changed:
                        yield {name: row[name] for name in row.keys()[:-1]}
        except (sqlite3.Error, UnicodeDecodeError):  # a message that quotes a damaged name is none
            self._cut_short.append(table)

    def lacks(self, connection: sqlite3.Connection) -> list[str]:
        """Return what it could not give and the new index does not have either."""
        missing = [
            f"Row {row} of {table}: the old index does not hold what was written."
            for table, row in self._changed
            if connection.execute(f"SELECT 1 FROM {table} WHERE rowid=?", (row,)).fetchone() is None
        ]
        return missing + self._refused

    def cut_short(self) -> list[str]:
        """Return the tables that could not be read to their end."""
        return self._cut_short


def _told(lines: Lines, old: OldIndex, known_n: int) -> tuple[list[str], list[str]]:
    """Return what is damaged in the journal, and which part of it the old index does not have."""
    unread = old.cut_short()
    damaged = [f"Line {line} of the journal is not what was written." for line in lines.damaged]
    if lines.id is None and not lines.n:
        if len(unread) == len(journal_rows.TABLES):
            return damaged, [f"Neither a journal nor an index can be read: {_IN_NO_FILE}."]
        return damaged, [f"The end of {table} in the old index." for table in unread]
    covered_n = 0 if unread else known_n
    lost = [
        f"Transactions {max(first, covered_n + 1)} to {last} of the journal."
        for first, last in lines.missing
        if last > covered_n
    ]
    if known_n > lines.n:
        damaged.append(
            f"The journal ends with transaction {lines.n}, the old index with {known_n}."
        )
    if lines.damaged_end and covered_n <= lines.n:
        lost.append(f"The end of the journal, from line {lines.damaged_end[0]} on.")
    elif known_n > lines.n and unread:
        lost.append(f"Transactions {lines.n + 1} to {known_n}, as far as {', '.join(unread)}.")
    return damaged, lost


def _changed(connection: sqlite3.Connection, table: str) -> set[int]:
    """Return the rows that are not what was written, and are left out."""
    known = "SELECT 1 FROM sqlite_master WHERE name=?"
    for name in ("row_digests", table):  # an index of an older version lacks the one or the other
        if connection.execute(known, (name,)).fetchone() is None:
            return set()
    return set(checksums.changed_rows(connection, table))
