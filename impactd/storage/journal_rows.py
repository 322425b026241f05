"""From rows of the index to changes in the journal, and back.

Triggers collect the changes, so that no table has to think of it; `checksums` does so for digests.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from impactd.storage import checksums
from impactd.storage.errors import ArchiveError
from impactd.storage.journal import Change

# ruff: noqa: S608 - nothing here but the names of our own tables and columns

POSITION = "journal_position"
TABLES = tuple(table for table in checksums.COLUMNS if table != POSITION)
"""What is journaled, in an order in which every row finds the rows that it names."""
_LATER = frozenset({"comparisons"})
"""Tables that came after the journal, each with `statements_of` in its own migration."""
_KEYS = {"named_models": ("name", "version")}
_SNAPSHOT_ROWS = 100
"""Rows of a snapshot in one line: a damaged line costs all of its rows."""

Collect = Callable[[str, tuple[Any, ...], tuple[Any, ...] | None], None]


def key_of(table: str) -> tuple[str, ...]:
    """Return the columns of a table's primary key."""
    return _KEYS.get(table, (checksums.COLUMNS[table].split()[0],))


def install(connection: sqlite3.Connection, collect: Collect) -> None:
    """Give a connection the functions that the triggers call.

    ``collect`` hears table, key and columns of each row after its change; ``None`` for a deleted
    one.
    """

    def written(table: str, *values: Any) -> None:
        """Collect a row that was inserted or updated."""
        named = dict(zip(checksums.COLUMNS[table].split(), values, strict=True))
        collect(table, tuple(named[name] for name in key_of(table)), values)

    connection.create_function("journal_row", -1, written)
    connection.create_function(
        "journal_deletion", -1, lambda table, *key: collect(table, tuple(key), None)
    )


def migration() -> tuple[str, ...]:
    """Return the statements that give an index its journal."""
    statements = [
        f"CREATE TABLE {POSITION} (id INTEGER PRIMARY KEY CHECK (id = 1), journal TEXT NOT NULL, "
        "n INTEGER NOT NULL, size_bytes INTEGER NOT NULL) STRICT",
        *checksums.statements_of(POSITION),
    ]
    for table in TABLES:
        if table not in _LATER:
            statements += statements_of(table)
    return tuple(statements)


def statements_of(table: str) -> Iterator[str]:
    """Yield the statements that journal one table, one trigger each.

    Yields
    ------
    str
        SQL.
    """
    yield from triggers_of(table, checksums.first_columns(table))
    key = ", ".join(f"old.{name}" for name in key_of(table))
    yield (
        f"CREATE TRIGGER {table}_delete_journal AFTER DELETE ON {table} BEGIN "
        f"SELECT journal_deletion('{table}', {key}); END"
    )


def triggers_of(table: str, columns: Sequence[str]) -> Iterator[str]:
    """Yield the statements that journal what is written into a table with these columns."""
    values = ", ".join(f"new.{name}" for name in columns)
    for event in ("INSERT", "UPDATE"):
        yield (
            f"CREATE TRIGGER {table}_{event.lower()}_journal AFTER {event} ON {table} BEGIN "
            f"SELECT journal_row('{table}', {values}); END"
        )


class Collected:
    """The changes of one transaction."""

    def __init__(self) -> None:
        self.rows: list[Change] = []

    def add(self, table: str, key: tuple[Any, ...], values: tuple[Any, ...] | None) -> None:
        """Add a change; deleted rows that follow one another become one range."""
        if values is not None:
            self.rows.append(
                [table, dict(zip(checksums.COLUMNS[table].split(), values, strict=True))]
            )
            return
        last = self.rows[-1] if self.rows else []
        follows = len(last) == 3 and last[0] == table and len(key) == 1
        if follows and isinstance(key[0], int) and last[2] == [key[0] - 1]:
            last[2] = list(key)
        else:
            self.rows.append([table, list(key), list(key)])


def apply(connection: sqlite3.Connection, rows: Sequence[Change]) -> None:
    """Make the changes of one line in an index; the caller holds the transaction.

    Raises ArchiveError if the index has no such table or column, sqlite3.Error if it refuses a row.
    """
    for table, first, *last in rows:
        if table not in TABLES:
            raise _unknown(f"table {table}")
        if last:
            names, marks = ", ".join(key_of(table)), ", ".join("?" * len(first))
            connection.execute(
                f"DELETE FROM {table} WHERE ({names}) BETWEEN ({marks}) AND ({marks})",
                (*first, *last[0]),
            )
            continue
        if unknown := set(first) - set(checksums.COLUMNS[table].split()):
            raise _unknown(f"column {', '.join(sorted(unknown))} of {table}")
        put(connection, table, first)


def put(connection: sqlite3.Connection, table: str, row: dict[str, Any]) -> None:
    """Insert a row, or update the one of its key; no other row is replaced."""
    # No upsert: its way with conflicts would replace that of the triggers' own statements.
    keys = " AND ".join(f"{name}=?" for name in key_of(table))
    news = ", ".join(f"{name}=?" for name in row)
    found = tuple(row[name] for name in key_of(table))
    values = tuple(row.values())
    done = connection.execute(f"UPDATE {table} SET {news} WHERE {keys}", (*values, *found))
    if not done.rowcount:
        marks = ", ".join("?" * len(row))
        connection.execute(f"INSERT INTO {table} ({', '.join(row)}) VALUES ({marks})", values)


def snapshot(connection: sqlite3.Connection) -> Iterator[list[Change]]:
    """Yield all rows of an index as transactions of a new journal; nobody else writes meanwhile.

    Yields
    ------
    list
        Some hundred rows of one table.
    """
    for table in TABLES:
        names = checksums.COLUMNS[table].split()
        found = connection.execute(
            f"SELECT {', '.join(names)} FROM {table} ORDER BY {', '.join(key_of(table))}"
        )
        while rows := found.fetchmany(_SNAPSHOT_ROWS):
            yield [[table, dict(zip(names, tuple(row), strict=True))] for row in rows]


def _unknown(what: str) -> ArchiveError:
    return ArchiveError(
        f"The journal names the {what}, which this program does not know.",
        why="A newer impactd wrote it.",
        remedy="Install that version again.",
    )
