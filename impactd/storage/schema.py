"""The form of the index: the migrations that make it, and what a sound one looks like.

Its columns as they are now are `checksums.COLUMNS`.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from functools import cache

from impactd.storage import checksums, journal_rows


def added_column(table: str, name: str) -> tuple[str, ...]:
    """Return the statements that add a last column of text to a table of `checksums.COLUMNS`."""
    columns = checksums.COLUMNS[table].split()
    after = columns[: columns.index(name) + 1]
    events = [f"{table}_{event}" for event in ("insert", "update")]
    return (
        f"ALTER TABLE {table} ADD COLUMN {name} TEXT",
        checksums.renewal(table, after[:-1], after),
        *(f"DROP TRIGGER {event}_{what}" for event in events for what in ("digest", "journal")),
        *checksums.triggers_of(table, after),
        *journal_rows.triggers_of(table, after),
    )


MIGRATIONS: tuple[str | tuple[str, ...], ...] = (
    """
    CREATE TABLE sequence (name TEXT PRIMARY KEY, last INTEGER NOT NULL) STRICT;
    INSERT INTO sequence VALUES ('drop', 0);

    CREATE TABLE calibrations (
        number INTEGER PRIMARY KEY AUTOINCREMENT, slot TEXT UNIQUE, plan TEXT NOT NULL,
        owner TEXT NOT NULL, state TEXT NOT NULL, result TEXT, problem TEXT,
        requested_utc TEXT NOT NULL, finished_utc TEXT, valid_until_utc TEXT) STRICT;

    CREATE TABLE drops (
        number INTEGER PRIMARY KEY, state TEXT NOT NULL, sphere TEXT NOT NULL,
        surface TEXT NOT NULL, drop_height_m REAL NOT NULL, operator TEXT NOT NULL,
        owner TEXT NOT NULL, idempotency_key TEXT UNIQUE,
        calibration INTEGER REFERENCES calibrations(number), problem TEXT,
        requested_utc TEXT NOT NULL, updated_utc TEXT NOT NULL) STRICT;
    CREATE INDEX drops_by_state ON drops(state);
    CREATE INDEX drops_by_calibration ON drops(calibration);

    CREATE TABLE shots (
        number INTEGER PRIMARY KEY, file TEXT NOT NULL UNIQUE, sha256 TEXT NOT NULL,
        size_bytes INTEGER NOT NULL, source TEXT NOT NULL, origin TEXT NOT NULL,
        started_utc TEXT NOT NULL,
        stored_utc TEXT NOT NULL, sphere TEXT, surface TEXT, drop_height_m REAL,
        operator TEXT NOT NULL, quantity TEXT NOT NULL, sample_rate_hz REAL NOT NULL,
        samples INTEGER NOT NULL, trigger_index INTEGER NOT NULL, peak REAL NOT NULL,
        clipped INTEGER NOT NULL) STRICT;
    CREATE INDEX shots_by_pair ON shots(surface, sphere);
    CREATE INDEX shots_by_time ON shots(started_utc);
    CREATE UNIQUE INDEX shots_by_origin ON shots(origin) WHERE origin != '';

    CREATE TABLE jobs (
        id INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, subject TEXT NOT NULL,
        payload TEXT NOT NULL, key TEXT UNIQUE, state TEXT NOT NULL, attempts INTEGER NOT NULL,
        runner TEXT, result TEXT, reason TEXT, created_utc TEXT NOT NULL, started_utc TEXT,
        finished_utc TEXT) STRICT;
    CREATE INDEX jobs_by_state ON jobs(state, id);

    CREATE TABLE fits (
        id INTEGER PRIMARY KEY AUTOINCREMENT, shot INTEGER REFERENCES shots(number),
        model TEXT NOT NULL, calibration INTEGER REFERENCES calibrations(number),
        job INTEGER, result TEXT NOT NULL, created_utc TEXT NOT NULL) STRICT;
    CREATE INDEX fits_by_shot ON fits(shot, model, id);

    CREATE TABLE events (
        id INTEGER PRIMARY KEY AUTOINCREMENT, utc TEXT NOT NULL, kind TEXT NOT NULL,
        data TEXT NOT NULL) STRICT;

    CREATE TABLE tokens (
        id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL, scope TEXT NOT NULL,
        secret_sha256 TEXT NOT NULL UNIQUE, created_utc TEXT NOT NULL, expires_utc TEXT,
        revoked_utc TEXT) STRICT;

    CREATE TABLE active_models (
        id INTEGER PRIMARY KEY AUTOINCREMENT, name TEXT NOT NULL, since_utc TEXT NOT NULL) STRICT;
    """,
    # A re-fit of the archive writes each shot once per model, whatever is killed and started again.
    """
    ALTER TABLE fits ADD COLUMN run TEXT;
    CREATE UNIQUE INDEX fits_by_run ON fits(run, shot, model) WHERE run IS NOT NULL;
    """,
    """
    CREATE TABLE named_models (
        name TEXT NOT NULL, version INTEGER NOT NULL, definition TEXT NOT NULL,
        provenance TEXT NOT NULL, created_utc TEXT NOT NULL, PRIMARY KEY (name, version)) STRICT;
    ALTER TABLE active_models ADD COLUMN version INTEGER;
    """,
    # How high a sphere came back is seen after the drop, and entered then.
    """
    ALTER TABLE drops ADD COLUMN rebound_height_m REAL;
    ALTER TABLE drops ADD COLUMN u_rebound_height_m REAL;
    """,
    checksums.migration(),
    # What went wrong is shown until somebody says that it was seen, over restarts.
    (
        "CREATE TABLE alarms (id INTEGER PRIMARY KEY AUTOINCREMENT, kind TEXT NOT NULL, "
        "sentence TEXT NOT NULL, remedy TEXT NOT NULL, times INTEGER NOT NULL, "
        "first_utc TEXT NOT NULL, last_utc TEXT NOT NULL, acknowledged_utc TEXT, "
        "acknowledged_by TEXT) STRICT",
        *checksums.statements_of("alarms"),
    ),
    # What the index holds and no file does is kept in a journal beside it.
    journal_rows.migration(),
    # Temperature and humidity: as the technician read them, and as they were at the shot.
    (*added_column("drops", "environment"), *added_column("shots", "environment")),
    # Each drop's shot beside its repetitions, as it was seen right after.
    (
        "CREATE TABLE comparisons (shot INTEGER PRIMARY KEY REFERENCES shots(number), "
        "result TEXT NOT NULL, created_utc TEXT NOT NULL) STRICT",
        *checksums.statements_of("comparisons"),
        *journal_rows.statements_of("comparisons"),
    ),
)
"""One step per version of the index; a step is never changed once it was released."""


def migrate(connection: sqlite3.Connection, version: int) -> None:
    """Bring an index from a version (0 for a new one) to the present one.

    The caller holds the transaction; the connection has `checksums.install` and
    `journal_rows.install`.
    """
    for step in MIGRATIONS[version:]:
        for statement in step.split(";") if isinstance(step, str) else step:
            if statement.strip():
                connection.execute(statement)
    if version < len(MIGRATIONS):
        connection.execute(f"PRAGMA user_version={len(MIGRATIONS)}")


def changed_form(connection: sqlite3.Connection) -> list[str]:
    """Return in what the tables, columns and triggers are not as this program makes them.

    The index is of the present version. One sentence each; empty when all is well.
    """
    return [
        f"the {kind} {name} is not as this program makes it."
        for kind, name, *_ in sorted(_expected() ^ _form(connection))
    ]


def _form(connection: sqlite3.Connection) -> frozenset[tuple[str, ...]]:
    rows = connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master")
    return frozenset(tuple(" ".join(str(part).split()) for part in row) for row in rows)


@cache
def _expected() -> frozenset[tuple[str, ...]]:
    """Return the form of a new index; no migration may change its text."""
    with closing(sqlite3.connect(":memory:")) as new:
        checksums.install(new)
        journal_rows.install(new, lambda *_: None)
        migrate(new, 0)
        return _form(new)
