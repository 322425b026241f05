"""A checksum for every row of the index: SQLite finds a broken page, never a changed number.

Triggers write them, so that no table has to think of it. Whoever writes into the index from
outside this program is refused, as the triggers call a function that only this program has.
"""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator, Sequence

# Who adds a column puts it last, names it in `_ADDED` too, and writes a migration with
# `schema.added_column`; a test compares this list with the tables.
COLUMNS: dict[str, str] = {
    "sequence": "name last",
    "calibrations": "number slot plan owner state result problem requested_utc finished_utc "
    "valid_until_utc",
    "drops": "number state sphere surface drop_height_m operator owner idempotency_key calibration "
    "problem requested_utc updated_utc rebound_height_m u_rebound_height_m environment",
    "shots": "number file sha256 size_bytes source origin started_utc stored_utc sphere surface "
    "drop_height_m operator quantity sample_rate_hz samples trigger_index peak clipped "
    "environment",
    "jobs": "id kind subject payload key state attempts runner result reason created_utc "
    "started_utc finished_utc",
    "fits": "id shot model calibration job result created_utc run",
    "events": "id utc kind data",
    "tokens": "id name scope secret_sha256 created_utc expires_utc revoked_utc",
    "active_models": "id name since_utc version",
    "named_models": "name version definition provenance created_utc",
    "alarms": "id kind sentence remedy times first_utc last_utc acknowledged_utc acknowledged_by",
    "comparisons": "shot result created_utc",
    "journal_position": "id journal n size_bytes",
}
"""Tables and their columns."""
_LATER = frozenset({"alarms", "journal_position", "comparisons"})
"""Tables that came after the checksums, each with `statements_of` in its own migration."""
_ADDED = {"drops": {"environment"}, "shots": {"environment"}}
"""Columns that came after checksums and journal."""


def first_columns(table: str) -> list[str]:
    """Return the columns that a table had when it got its checksums and its journal."""
    return [name for name in COLUMNS[table].split() if name not in _ADDED.get(table, ())]


def install(connection: sqlite3.Connection) -> None:
    """Give a connection the function that the triggers call."""
    connection.create_function("row_digest", -1, _digest, deterministic=True)


def _digest(*values: object) -> int:
    found = hashlib.blake2b(repr(values).encode(), digest_size=8).digest()
    return int.from_bytes(found, "big", signed=True)


def migration() -> tuple[str, ...]:
    """Return the statements that give an index its checksums."""
    statements = [
        "CREATE TABLE row_digests (kind TEXT NOT NULL, row INTEGER NOT NULL, "
        "digest INTEGER NOT NULL, PRIMARY KEY (kind, row)) STRICT, WITHOUT ROWID"
    ]
    for table in COLUMNS:
        if table not in _LATER:
            statements += statements_of(table)
    return tuple(statements)


def statements_of(table: str) -> Iterator[str]:
    """Yield the statements that give a table of `COLUMNS` its checksums.

    Yields
    ------
    str
        SQL that fills the table of digests, and its triggers.
    """
    # ruff: noqa: S608 - nothing here but the names of our own tables and columns
    columns = first_columns(table)
    yield (f"INSERT INTO row_digests SELECT '{table}', rowid, {_call(columns, '')} FROM {table}")
    yield from triggers_of(table, columns)
    yield (
        f"CREATE TRIGGER {table}_delete_digest AFTER DELETE ON {table} BEGIN "
        f"DELETE FROM row_digests WHERE kind='{table}' AND row=old.rowid; END"
    )


def triggers_of(table: str, columns: Sequence[str]) -> Iterator[str]:
    """Yield the statements that keep the checksums of a table with these columns."""
    for event in ("INSERT", "UPDATE"):
        yield (
            f"CREATE TRIGGER {table}_{event.lower()}_digest AFTER {event} ON {table} BEGIN "
            f"INSERT OR REPLACE INTO row_digests VALUES ('{table}', new.rowid, "
            f"{_call(columns, 'new.')}); END"
        )


def renewal(table: str, before: Sequence[str], after: Sequence[str]) -> str:
    """Return the statement that lets the checksums of a table cover more columns.

    A row that is not what was written keeps its checksum, and goes on being found.
    """
    row = f"FROM {table} t WHERE t.rowid=row_digests.row"
    return (
        f"UPDATE row_digests SET digest=(SELECT {_call(after, 't.')} {row}) "
        f"WHERE kind='{table}' AND digest=(SELECT {_call(before, 't.')} {row})"
    )


def changed_rows(connection: sqlite3.Connection, table: str) -> Iterator[int]:
    """Yield the row ids that are not what was written, missing ones included.

    Any connection to an index will do, also one beside the program's own.
    """
    install(connection)
    # An index of an older version lacks what was added since.
    present = {name for _, name, *_ in connection.execute(f"PRAGMA table_info({table})")}
    columns = [name for name in COLUMNS[table].split() if name in present]
    rows = connection.execute(
        f"SELECT t.rowid FROM {table} t LEFT JOIN row_digests d ON d.kind=? AND d.row=t.rowid "
        f"WHERE d.digest IS NULL OR d.digest <> {_call(columns, 't.')} UNION ALL "
        f"SELECT row FROM row_digests WHERE kind=? AND row NOT IN (SELECT rowid FROM {table})",
        (table, table),
    )
    for row in rows.fetchall():
        yield int(row[0])


def _call(columns: Sequence[str], prefix: str) -> str:
    return f"row_digest({', '.join(prefix + name for name in columns)})"
