"""The SQLite file behind all tables: connection, transactions, migrations.

It is an index and a job table, never the truth: the shot files are, and ``reindex`` rebuilds this
file from them.

Two connections serve all threads of a process, each behind its own lock, so that no connection is
left behind by a thread pool: one writes and waits for the disk at every commit, the other one only
reads and never waits for it. A thread inside a transaction reads what it has just written. Other
processes (``impactd token create`` beside a running daemon) have their own connections; WAL and the
busy timeout let them share.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from functools import cache
from pathlib import Path
from typing import Any

from impactd.storage import checksums
from impactd.storage.errors import ArchiveError, StorageFullError

BUSY_TIMEOUT_S = 10.0
_IN_MEMORY = ":memory:"

_MIGRATIONS: tuple[str | tuple[str, ...], ...] = (
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
)


class Index:
    """The SQLite file behind all tables.

    Parameters
    ----------
    path : Path
        Created when absent, migrated when older than this program.

    Raises
    ------
    ArchiveError
        If the file is no index, is damaged, or was written by a newer program.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = threading.RLock()
        self._reading = threading.Lock()
        self._depth = 0
        self._writer = 0
        self._connection = self._reader = self._connect()
        try:
            with self._translated():
                checksums.install(self._connection)
                self._connection.execute("PRAGMA journal_mode=WAL")
                self._connection.execute("PRAGMA synchronous=FULL")
                self._connection.execute("PRAGMA foreign_keys=ON")
            self._migrate()
            self._check_form()
            if str(path) != _IN_MEMORY:
                self._reader = self._connect()
                with self._translated():
                    self._reader.execute("PRAGMA query_only=ON")
        except BaseException:
            self.close()
            raise

    def _connect(self) -> sqlite3.Connection:
        with self._translated():
            connection = sqlite3.connect(
                self.path, timeout=BUSY_TIMEOUT_S, isolation_level=None, check_same_thread=False
            )
        connection.row_factory = sqlite3.Row
        return connection

    def _migrate(self) -> None:
        # The version is read inside the write transaction: two processes may open a new archive
        # at the same moment, and the second one must see what the first one did.
        with self.transaction():
            version = self.number("PRAGMA user_version")
            if version > len(_MIGRATIONS):
                raise ArchiveError(
                    f"{self.path} has version {version}; this program knows {len(_MIGRATIONS)}.",
                    why="A newer impactd wrote it.",
                    remedy="Install that version again.",
                )
            for step in _MIGRATIONS[version:]:
                for statement in step.split(";") if isinstance(step, str) else step:
                    if statement.strip():
                        self._connection.execute(statement)
            if version < len(_MIGRATIONS):
                self._connection.execute(f"PRAGMA user_version={len(_MIGRATIONS)}")

    @contextmanager
    def _translated(self) -> Iterator[None]:
        try:
            yield
        except (sqlite3.Error, UnicodeDecodeError) as error:
            # SQLite quotes a damaged name in its message, which then is no text.
            if "disk is full" in str(error):
                raise StorageFullError(
                    str(self.path.parent),
                    free_bytes=shutil.disk_usage(self.path.parent).free,
                    needed_bytes=0,
                ) from error
            if isinstance(error, sqlite3.IntegrityError):
                raise ArchiveError(
                    f"The index refused a row: {error}.",
                    why="It names a drop, shot or calibration that is unknown, or exists twice.",
                ) from error
            raise ArchiveError(
                f"The index {self.path} does not answer: {error}.",
                why="The file is damaged, not writable or held by another process.",
                remedy="Check its owner and the disk; `impactd reindex` rebuilds it.",
            ) from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Hold the write lock; commit durably at the end, roll back on any error.

        Inner transactions join the outer one.
        """
        with self._lock, self._translated():
            if self._depth == 0:
                self._connection.execute("BEGIN IMMEDIATE")
                self._writer = threading.get_ident()
            self._depth += 1
            try:
                yield
            except BaseException:
                self._depth -= 1
                if self._depth == 0:
                    self._writer = 0
                    if self._connection.in_transaction:
                        self._connection.execute("ROLLBACK")
                raise
            self._depth -= 1
            if self._depth == 0:
                self._writer = 0
                self._commit()

    def _commit(self) -> None:
        try:
            self._connection.execute("COMMIT")
        except sqlite3.Error:
            # A disk that is full or broken leaves the transaction open, and with it the index
            # would refuse every later one.
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            raise

    def write(self, sql: str, values: Sequence[object] = ()) -> int:
        """Run one statement in a transaction.

        Parameters
        ----------
        sql : str
            One statement with ``?`` for each value.
        values : sequence
            Its values.

        Returns
        -------
        int
            The row id of an INSERT, else the number of rows changed.
        """
        with self.transaction():
            cursor = self._connection.execute(sql, tuple(values))
            if sql.lstrip()[:6].upper() == "INSERT":
                return int(cursor.lastrowid or 0)
            return cursor.rowcount

    def rows(self, sql: str, values: Sequence[object] = ()) -> list[sqlite3.Row]:
        """Return all rows of a query.

        Parameters
        ----------
        sql : str
            One SELECT with ``?`` for each value.
        values : sequence
            Its values.

        Returns
        -------
        list of sqlite3.Row
            May be empty.
        """
        own = self._writer == threading.get_ident() or self._reader is self._connection
        connection, lock = (self._connection, self._lock) if own else (self._reader, self._reading)
        with lock, self._translated():
            return connection.execute(sql, tuple(values)).fetchall()

    def row(self, sql: str, values: Sequence[object] = ()) -> sqlite3.Row | None:
        """Return the first row of a query.

        Parameters
        ----------
        sql : str
            One SELECT with ``?`` for each value.
        values : sequence
            Its values.

        Returns
        -------
        sqlite3.Row or None
            ``None`` when there is none.
        """
        found = self.rows(sql, values)
        return found[0] if found else None

    def number(self, sql: str, values: Sequence[object] = ()) -> int:
        """Return the first column of the first row as an integer, 0 where there is none.

        Parameters
        ----------
        sql : str
            One SELECT with ``?`` for each value.
        values : sequence
            Its values.

        Returns
        -------
        int
            The number.
        """
        found = self.row(sql, values)
        return int(found[0] or 0) if found is not None else 0

    def problems(self) -> Iterator[str]:
        """Yield what is wrong with the file: its pages, its form, its rows.

        Yields
        ------
        str
            One sentence each; none when it is sound.
        """
        for look in (self._broken_pages, self._changed_form, self._changed_rows):
            try:
                with self._lock, self._translated():
                    yield from list(look())
            except ArchiveError as error:
                yield str(error)

    def _broken_pages(self) -> Iterator[str]:
        for row in self._connection.execute("PRAGMA integrity_check"):
            if row[0] != "ok":
                yield str(row[0])
        for row in self._connection.execute("PRAGMA foreign_key_check"):
            yield f"row {row[1]} of {row[0]} names a {row[2]} that is not there."

    def _changed_form(self) -> Iterator[str]:
        if str(self.path) == _IN_MEMORY:
            return
        for kind, name, *_ in _form() ^ self._form_of_this():
            yield f"the {kind} {name} is not as this program makes it."

    def _form_of_this(self) -> frozenset[tuple[str, ...]]:
        rows = self._connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_master")
        return frozenset(tuple(" ".join(str(part).split()) for part in row) for row in rows)

    def _check_form(self) -> None:
        # A flipped bit in a column's name would be met anywhere, as an error of any kind.
        with self._translated():
            wrong = list(self._changed_form())
        if wrong:
            raise ArchiveError(
                f"The index {self.path} is damaged: {'; '.join(wrong)}",
                why="The file was changed after it was written.",
                remedy="Stop the daemon and run `impactd reindex`: it rebuilds it from the files.",
            )

    def _changed_rows(self) -> Iterator[str]:
        for table in checksums.COLUMNS:
            for row in checksums.changed_rows(self._connection, table):
                yield f"row {row} of {table} is not what was written."

    def close(self) -> None:
        """Give the file back."""
        with self._lock, self._reading:
            self._reader.close()
            self._connection.close()


@cache
def _form() -> frozenset[tuple[str, ...]]:
    """Return tables, columns and triggers of a new index; no migration may change its text."""
    with closing(Index(Path(_IN_MEMORY))) as new:
        return new._form_of_this()


def as_text(value: object) -> str:
    """Return JSON text for a column; NaN and Infinity are refused, as everywhere in this program.

    Parameters
    ----------
    value : object
        Anything JSON can say.

    Returns
    -------
    str
        Compact, with sorted keys, so that equal values give equal text.
    """
    return json.dumps(value, allow_nan=False, sort_keys=True, separators=(",", ":"))


def from_text(text: str) -> Any:
    """Return the value of a column that `as_text` wrote.

    Parameters
    ----------
    text : str
        JSON.

    Returns
    -------
    object
        The value.

    Raises
    ------
    ArchiveError
        If it is no JSON any more.
    """
    try:
        return json.loads(text)
    except (ValueError, TypeError) as error:
        raise ArchiveError(
            f"A row of the index cannot be read: {error}.",
            why="The file was changed after it was written.",
            remedy="Run `impactd verify`; `impactd reindex` rebuilds the index from the files.",
        ) from error
