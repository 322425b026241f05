"""The SQLite file behind all tables: connections, transactions, integrity.

It is an index and a job table, never the truth: that are the shot files and the journal, and
``reindex`` rebuilds this file from them.

Three connections serve all threads of a process, each behind its own lock, so that no connection is
left behind by a thread pool: one writes and waits for the disk at every commit, one only reads and
never waits for it, and one only looks tokens up, so that a long query delays nobody's login. A
thread inside a transaction reads what it has just written. Other processes (``impactd token
create`` beside a running daemon) have their own connections; WAL and the busy timeout let them
share.
"""

from __future__ import annotations

import json
import os
import shutil
import sqlite3
import threading
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from impactd.storage import checksums, schema
from impactd.storage.errors import ArchiveError, StorageFullError
from impactd.storage.journal import JOURNAL_NAME
from impactd.storage.journaling import Journaling
from impactd.storage.publish import sync_directory

BUSY_TIMEOUT_S = 10.0
_LOCK_POLL_S = 0.01
_MODE = 0o640
"""At most: it holds names, and hashes of tokens."""
_SIDECARS = ("", "-wal", "-shm")


class Index:
    """The SQLite file of all tables.

    Parameters
    ----------
    path : Path
        Created when absent, migrated when older than this program; its journal is beside it.
    scratch : bool
        Whether it is only being built: without a journal, for one thread, and nothing is synced.

    Raises
    ------
    ArchiveError
        If the file is no index, is damaged, was written by a newer program, or does not belong to
        its journal.
    """

    def __init__(self, path: Path, *, scratch: bool = False) -> None:
        self.path = path
        self.journal_path = path.with_name(JOURNAL_NAME)
        self._lock = threading.RLock()
        self._reading = threading.Lock()
        self._looking_up = threading.Lock()
        self._depth = 0
        self._writer = 0
        self._close_to_others()
        self._connection = self._reader = self._tokens = self._connect()
        try:
            self._journaling = Journaling(self._connection, None if scratch else self.journal_path)
            with self._translated():
                checksums.install(self._connection)
                self._choose_log("MEMORY" if scratch else "WAL")
                self._connection.execute(f"PRAGMA synchronous={'OFF' if scratch else 'FULL'}")
                self._connection.execute("PRAGMA foreign_keys=ON")
            self._migrate()
            self._check_form()
            if not scratch:
                self._reader, self._tokens = self._connect(), self._connect()
                with self._translated():
                    # The journal is synced before each commit: what a power cut takes of the
                    # index is replayed from it.
                    self._connection.execute("PRAGMA synchronous=NORMAL")
                    self._reader.execute("PRAGMA query_only=ON")
                    self._tokens.execute("PRAGMA query_only=ON")
        except BaseException:
            self.close()
            raise

    def _close_to_others(self) -> None:
        """Create the file, or narrow its mode: SQLite gives it to its sidecars."""
        try:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, _MODE)
            os.close(descriptor)
            for suffix in _SIDECARS:
                sidecar = self.path.with_name(self.path.name + suffix)
                with suppress(FileNotFoundError, PermissionError):  # PermissionError: of another
                    mode = sidecar.stat().st_mode & 0o777
                    if mode & ~_MODE:
                        sidecar.chmod(mode & _MODE)
        except OSError as error:
            raise ArchiveError(
                f"The index {self.path} cannot be opened: {error.strerror}.",
                remedy="Check storage.directory, its owner and its mode.",
            ) from error

    def _choose_log(self, mode: str) -> None:
        """Set the journal mode; SQLite does not wait there for a process that does the same."""
        ends_s = time.monotonic() + BUSY_TIMEOUT_S
        while True:
            try:
                self._connection.execute(f"PRAGMA journal_mode={mode}")
            except sqlite3.OperationalError as error:
                if "locked" not in str(error) or time.monotonic() > ends_s:
                    raise
                time.sleep(_LOCK_POLL_S)
            else:
                return

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
            if version > len(schema.MIGRATIONS):
                raise ArchiveError(
                    f"{self.path} has version {version}; this program knows "
                    f"{len(schema.MIGRATIONS)}.",
                    why="A newer impactd wrote it.",
                    remedy="Install that version again.",
                )
            self._journaling.open()
            schema.migrate(self._connection, version)
            first = self._journaling.begin_first()
        if first:
            with self.transaction(), self._translated_files():
                sync_directory(self.path.parent)
                self._journaling.finish_first()

    @contextmanager
    def _translated_files(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise ArchiveError(
                f"The disk of {self.path.parent} does not write: {error.strerror}.",
                remedy="Check the disk (`dmesg`), then start the daemon again.",
            ) from error

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
                    why=(
                        "It names an unknown drop, shot or calibration, or one that exists twice."
                    ),
                ) from error
            raise self._no_answer(str(error)) from error

    def _no_answer(self, what: str) -> ArchiveError:
        return ArchiveError(
            f"The index {self.path} does not answer: {what}.",
            why="The file is damaged, not writable or held by another process.",
            remedy="Check its owner and the disk; `impactd reindex` rebuilds it.",
        )

    @contextmanager
    def transaction(self, timeout_s: float | None = None) -> Iterator[None]:
        """Hold the write lock; commit durably at the end, roll back on any error.

        Inner transactions join the outer one. The lock is waited for ``timeout_s`` at most, then
        ArchiveError is raised; without it, other processes are waited for 10 s, and threads of this
        one until they are done.
        """
        with self._locked(timeout_s) as left_s, self._translated():
            if self._depth == 0:
                self._connection.execute(f"PRAGMA busy_timeout={round(1000 * left_s)}")
                self._connection.execute("BEGIN IMMEDIATE")
                self._writer = threading.get_ident()
            self._depth += 1
            try:
                yield
            except BaseException:
                self._depth -= 1
                if self._depth == 0:
                    self._roll_back()
                raise
            self._depth -= 1
            if self._depth == 0:
                self._commit()

    @contextmanager
    def _locked(self, timeout_s: float | None) -> Iterator[float]:
        """Hold the lock of this process's writers; yield what is left of the time."""
        began_s = time.monotonic()
        if not self._lock.acquire(timeout=-1 if timeout_s is None else timeout_s):
            raise self._no_answer(f"another thread has been writing for {timeout_s:g} s")
        try:
            waited_s = time.monotonic() - began_s
            yield BUSY_TIMEOUT_S if timeout_s is None else max(timeout_s - waited_s, 0.0)
        finally:
            self._lock.release()

    def _roll_back(self) -> None:
        self._writer = 0
        self._journaling.forget()
        if self._connection.in_transaction:
            self._connection.execute("ROLLBACK")

    def _commit(self) -> None:
        try:
            self._journaling.write()
            self._connection.execute("COMMIT")
            self._writer = 0
            self._journaling.forget()
        except BaseException:
            # A disk that is full or broken leaves the transaction open, and with it the index
            # would refuse every later one.
            self._roll_back()
            self._journaling.take_back()
            raise

    def write(self, sql: str, values: Sequence[object] = ()) -> int:
        """Run one statement with ``?`` for each value, in a transaction.

        Return the row id of an INSERT, else the number of rows changed.
        """
        with self.transaction():
            collected = self._journaling.count()
            try:
                cursor = self._connection.execute(sql, tuple(values))
            except BaseException:
                # SQLite takes the statement back, and the transaction may go on without it.
                self._journaling.forget(collected)
                raise
            if sql.lstrip()[:6].upper() == "INSERT":
                return int(cursor.lastrowid or 0)
            return cursor.rowcount

    def rows(self, sql: str, values: Sequence[object] = ()) -> list[sqlite3.Row]:
        """Return all rows of one SELECT with ``?`` for each value."""
        return self._read(self._reader, self._reading, sql, values)

    def token_rows(self, sql: str, values: Sequence[object] = ()) -> list[sqlite3.Row]:
        """Return the rows of a SELECT that a key answers, without waiting for other readers."""
        return self._read(self._tokens, self._looking_up, sql, values)

    def _read(
        self,
        connection: sqlite3.Connection,
        lock: threading.Lock,
        sql: str,
        values: Sequence[object],
    ) -> list[sqlite3.Row]:
        if self._writer == threading.get_ident() or connection is self._connection:
            with self._lock, self._translated():
                return self._connection.execute(sql, tuple(values)).fetchall()
        with lock, self._translated():
            return connection.execute(sql, tuple(values)).fetchall()

    def row(self, sql: str, values: Sequence[object] = ()) -> sqlite3.Row | None:
        """Return the first row of a SELECT, ``None`` when there is none."""
        found = self.rows(sql, values)
        return found[0] if found else None

    def number(self, sql: str, values: Sequence[object] = ()) -> int:
        """Return the first column of the first row as an integer, 0 where there is none."""
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
        yield from schema.changed_form(self._connection)

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

    @contextmanager
    def raw(self) -> Iterator[sqlite3.Connection]:
        """Hold the connection itself, for a rebuild of the index."""
        with self._lock, self._translated():
            yield self._connection

    def close(self) -> None:
        """Close the connections and the journal."""
        with self._lock, self._reading, self._looking_up:
            self._journaling.close()
            for connection in (self._tokens, self._reader, self._connection):
                connection.close()


def as_text(value: object) -> str:
    """Return a value as compact JSON with sorted keys, so that equal values give equal text.

    NaN and Infinity are refused, as everywhere in this program.
    """
    return json.dumps(value, allow_nan=False, sort_keys=True, separators=(",", ":"))


def from_text(text: str) -> Any:
    """Return the value of a column that `as_text` wrote; raise ArchiveError if it is no JSON."""
    try:
        return json.loads(text)
    except (ValueError, TypeError) as error:
        raise ArchiveError(
            f"A row of the index cannot be read: {error}.",
            why="The file was changed after it was written.",
            remedy="Run `impactd verify`; `impactd reindex` rebuilds the index from the files.",
        ) from error
