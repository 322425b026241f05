"""The tie between an index and its journal: one line before each commit, replayed when it opens.

The line is synced, then the index commits with the new position in it. So the index is never ahead
of the journal; it may be behind by what was committed and lost with the power, or by one
transaction whose writer was killed. That is replayed when the index is opened. Whatever else does
not fit is refused: an index and a journal of different ids do not tell the same story.
"""

from __future__ import annotations

import sqlite3
from contextlib import suppress
from pathlib import Path

from impactd.storage import journal_rows
from impactd.storage.errors import ArchiveError
from impactd.storage.journal import Journal, Position, entries, id_of, write_whole
from impactd.storage.publish import sync_directory

_FIRST = ".first"
"""Suffix of the journal of an index that had none, until the index knows of it."""


class Journaling:
    """Keeps the changes of one connection in a journal; used by one thread at a time.

    Without a ``path`` the changes are kept in the index alone.
    """

    def __init__(self, connection: sqlite3.Connection, path: Path | None) -> None:
        self._connection = connection
        self._path = path
        self._journal: Journal | None = None
        self._collected = journal_rows.Collected()
        journal_rows.install(connection, self._collected.add)

    def open(self) -> None:
        """Open the journal and bring the index up to it; the caller holds the transaction.

        Raises ArchiveError if index and journal do not belong together.
        """
        if self._path is None:
            return
        at = position(self._connection)
        if at is None:
            if self._path.exists():
                raise _apart(self._path, "the index knows of no journal")
            return
        self._finish_first(at)
        if not self._path.exists():
            raise _apart(self._path, "the journal is gone")
        found = id_of(self._path)
        if found is None:
            raise _apart(self._path, "its first line is not what was written")
        if found != at.journal:
            raise _apart(self._path, f"the index belongs to {at.journal}, the journal is {found}")
        self._journal = Journal(self._path)
        if self._journal.size_bytes() < at.size_bytes:
            raise _apart(
                self._path,
                f"the index is ahead of it: {at.size_bytes} bytes were written, and "
                f"{self._journal.size_bytes()} are there",
            )
        self._replay(self._path, at)

    def begin_first(self) -> bool:
        """Write the journal of an index that has none, and return whether it had none.

        The caller commits, then calls `finish_first`.
        """
        if self._path is None or self._journal is not None:
            return False
        first = self._path.with_name(self._path.name + _FIRST)
        end = write_whole(first, journal_rows.snapshot(self._connection))
        sync_directory(first.parent)
        self._collected.rows.clear()
        self._journal = Journal(first)
        set_position(self._connection, end)
        return True

    def finish_first(self) -> None:
        """Rename a first journal to its name; the index that names it is durable."""
        at = position(self._connection)
        if self._path is not None and self._journal is not None and at is not None:
            self._finish_first(at)
            self._journal.path = self._path

    def _finish_first(self, at: Position) -> None:
        assert self._path is not None
        first = self._path.with_name(self._path.name + _FIRST)
        if self._path.exists() or not first.exists() or id_of(first) != at.journal:
            return
        with suppress(FileNotFoundError):  # another process has just done so
            first.rename(self._path)
        sync_directory(self._path.parent)

    def _replay(self, path: Path, at: Position) -> None:
        good, torn = at, 0
        self._connection.execute("PRAGMA defer_foreign_keys=ON")
        for entry in entries(path, start_bytes=at.size_bytes):
            if torn or (entry.body is not None and entry.body["n"] != good.n + 1):
                raise _apart(path, f"line {torn or entry.line} behind byte {at.size_bytes} is not "
                             "what was written")  # fmt: skip
            if entry.body is None:
                torn = entry.line
                continue
            journal_rows.apply(self._connection, entry.body["rows"])
            good = Position(at.journal, entry.body["n"], entry.end_bytes)
        if good != at:
            set_position(self._connection, good)
        if torn:
            assert self._journal is not None
            self._journal.cut(good.size_bytes)
        self._collected.rows.clear()

    def write(self) -> None:
        """Write what the transaction changed, durably; the caller commits next."""
        if not self._collected.rows or self._journal is None:
            return
        at = position(self._connection)
        assert at is not None
        set_position(self._connection, self._journal.append(at, self._collected.rows))

    def forget(self, count: int = 0) -> None:
        """Forget what was collected after the first ``count`` changes."""
        del self._collected.rows[count:]

    def count(self) -> int:
        """Return how many changes this transaction has collected."""
        return len(self._collected.rows)

    def take_back(self) -> None:
        """Remove the line of a commit that failed, as far as that is possible now."""
        if self._journal is None:
            return
        with suppress(sqlite3.Error):
            self._connection.execute("BEGIN IMMEDIATE")  # whoever holds it may have written since
            try:
                at = position(self._connection)
                if at is not None:
                    self._journal.cut(at.size_bytes)
            finally:
                self._connection.execute("ROLLBACK")

    def close(self) -> None:
        """Close the journal; safe to call twice."""
        if self._journal is not None:
            self._journal.close()


def position(connection: sqlite3.Connection) -> Position | None:
    """Return how far of its journal an index is, ``None`` for one without."""
    known = "SELECT 1 FROM sqlite_master WHERE name=?"
    if connection.execute(known, (journal_rows.POSITION,)).fetchone() is None:
        return None
    row = connection.execute("SELECT journal, n, size_bytes FROM journal_position").fetchone()
    return None if row is None else Position(*tuple(row))


def set_position(connection: sqlite3.Connection, at: Position) -> None:
    """Write how far of its journal an index is; the caller holds the transaction."""
    journal_rows.put(
        connection,
        journal_rows.POSITION,
        {"id": 1, "journal": at.journal, "n": at.n, "size_bytes": at.size_bytes},
    )


def _apart(path: Path, what: str) -> ArchiveError:
    return ArchiveError(
        f"The index (index.sqlite) and its journal {path} do not belong together: {what}.",
        why="A rebuild of the index was ended half-way, or one of the two files was replaced or "
        "damaged.",
        remedy="Stop the daemon and run `impactd reindex`: it rebuilds the index from journal and "
        "files.",
    )
