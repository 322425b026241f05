"""Rebuild the index from journal and files, in a file of its own, and swap it in at the end.

However the rebuild ends, one of two states remains: the old index with its journal, or the new
journal beside an index that does not belong to it (or none). The latter is refused at every start,
and the journal alone then gives everything back: it begins with a snapshot of what was rebuilt.
"""

from __future__ import annotations

import os
import sqlite3
from contextlib import closing, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from impactd.storage import journal_rows
from impactd.storage.calibrations import CalibrationTable
from impactd.storage.diagnoses import DIAGNOSES_NAME, DiagnosisStore
from impactd.storage.drops import DropTable
from impactd.storage.errors import ArchiveError, CorruptShotError
from impactd.storage.index import Index
from impactd.storage.journal import JOURNAL_NAME, write_whole
from impactd.storage.journaling import set_position
from impactd.storage.models import ModelTable
from impactd.storage.numbers import NumberSequence
from impactd.storage.problem import Problem
from impactd.storage.publish import sync_directory
from impactd.storage.reindex_sources import take_from_journal_and_index
from impactd.storage.shot_store import FoundShot, ShotStore
from impactd.storage.shots import ShotTable
from impactd.storage.timestamp import utc_now

# ruff: noqa: S608 - nothing here but the names of our own tables

_BUILDING = ".building"

_LOST_CALIBRATION = Problem(
    type="result-lost",
    title="Result lost with the index",
    status=500,
    detail="The index was rebuilt; the drops of this calibration are there, its result is not.",
    remedy="Run a new calibration.",
)


@dataclass(frozen=True)
class ReindexReport:
    """What a rebuilt index holds."""

    shots: int
    drops: int
    damaged: tuple[str, ...]
    """Files and lines of the journal that are not what was written, and what became of them."""
    kept: dict[str, int]
    """Rows it holds now, by table, and how many came from files of calibrations, diagnoses and
    choices of a model."""
    lost: tuple[str, ...]
    """What could not be restored, one sentence each."""
    last_number: int
    """The sequence goes on after it."""
    old_index: str | None
    """Where the old index was put."""


def rebuild_index(path: Path, store: ShotStore) -> ReindexReport:
    """Rebuild an index from its journal and the files; nobody else has the archive open.

    Where the journal is damaged or absent, the old index, which may be damaged or absent too, gives
    what it still can. Old index and old journal are kept under other names. Raises ArchiveError if
    the index cannot be written; the old one is then as it was.
    """
    remove_unfinished(path)
    building, journal = _building(path), _building(path.with_name(JOURNAL_NAME))
    try:
        with closing(Index(building, scratch=True)) as index:
            report = _fill(index, path, store)
            with index.raw() as connection:
                connection.execute("BEGIN")
                set_position(connection, write_whole(journal, journal_rows.snapshot(connection)))
                connection.execute("COMMIT")
        try:
            _sync(building)
            return replace(report, old_index=_swap(path))
        except OSError as error:
            raise ArchiveError(
                f"The rebuilt index cannot be put into place: {error}.",
                remedy="Check the disk (`dmesg`), and run `impactd reindex` again.",
            ) from error
    except BaseException:
        remove_unfinished(path)
        raise


def remove_unfinished(path: Path) -> None:
    """Remove the files of a rebuild that did not end; the caller knows that none is under way."""
    for name in (path, path.with_name(JOURNAL_NAME)):
        with suppress(OSError):
            _building(name).unlink(missing_ok=True)


def _building(path: Path) -> Path:
    return path.with_name(path.name + _BUILDING)


def _fill(index: Index, path: Path, store: ShotStore) -> ReindexReport:
    with index.raw() as connection:
        connection.execute("PRAGMA foreign_keys=OFF")  # checked at the end: rows come in any order
        with index.transaction():
            damaged, lost = take_from_journal_and_index(connection, path)
    calibrations = CalibrationTable(index, store.directory / "calibrations")
    diagnoses = DiagnosisStore(index, store.directory / DIAGNOSES_NAME)
    kept: dict[str, int] = {}
    kept["calibration files"], refused = calibrations.restore()
    damaged += refused
    kept["diagnosis files"], refused = diagnoses.restore()
    damaged += refused
    try:
        kept["active_models file"] = ModelTable(index, store.directory).restore_choices()
    except ArchiveError as error:
        damaged.append(str(error))
    with index.transaction():
        _take_files_in(index, store, damaged, lost)
    with index.raw() as connection, index.transaction():
        lost += _remove_orphans(connection)
    sequence = NumberSequence(index, store.directory)
    highest = index.number("SELECT max(number) FROM drops")
    sequence.raise_to(max(store.highest_number(), highest))
    for table in journal_rows.TABLES:
        kept[table] = index.number(f"SELECT count(*) FROM {table}")
    return ReindexReport(
        shots=kept["shots"],
        drops=kept["drops"],
        damaged=tuple(damaged),
        kept=kept,
        lost=tuple(lost),
        last_number=sequence.last(),
        old_index=None,
    )


def _take_files_in(index: Index, store: ShotStore, damaged: list[str], lost: list[str]) -> None:
    present = set()
    for file in store.paths():
        present.add(file.name)
        try:
            _take_in(index, store.find(file), damaged)
        except CorruptShotError as error:
            damaged.append(str(error))
    lost += [
        f"Shot {row['number']}: its file {row['file']} is not there."
        for row in index.rows("SELECT number, file FROM shots ORDER BY number")
        if Path(row["file"]).name not in present
    ]


def _take_in(index: Index, found: FoundShot, damaged: list[str]) -> None:
    number = found.row.number
    known = index.row("SELECT sha256 FROM shots WHERE number=?", (number,))
    if known is None:
        ShotTable(index).add(found.row)
    elif known["sha256"] != found.row.sha256:
        # The old hash stays, so that reading the shot goes on being refused.
        damaged.append(f"Shot {number} is not the file that was stored: its SHA-256 differs.")
    drop = found.drop
    if drop is None:
        return
    if drop.calibration is not None:
        index.write(
            "INSERT OR IGNORE INTO calibrations (number, plan, owner, state, problem, "
            "requested_utc) VALUES (?, '[]', ?, 'failed', ?, ?)",
            (drop.calibration, drop.owner, _LOST_CALIBRATION.to_text(), drop.requested_utc),
        )
    kept = index.row("SELECT * FROM drops WHERE number=?", (number,))
    if kept is None:
        DropTable(index).restore(drop)
    elif kept["state"] not in ("stored", "analysed"):
        heights = {name: kept[name] for name in ("rebound_height_m", "u_rebound_height_m")}
        DropTable(index).restore(replace(drop, **heights))


def _remove_orphans(connection: sqlite3.Connection) -> list[str]:
    """Remove rows that name a row that does not exist; return a sentence for each."""
    gone = []
    for table, row, parent, _ in connection.execute("PRAGMA foreign_key_check").fetchall():
        connection.execute(f"DELETE FROM {table} WHERE rowid=?", (row,))
        gone.append(f"Row {row} of {table}: it names one of {parent} that is lost.")
    return gone


def _swap(path: Path) -> str | None:
    """Put the new index and journal in the place of the old ones; return where the old index is."""
    folder, journal = path.parent, path.with_name(JOURNAL_NAME)
    aside = f".before-{utc_now().replace(':', '')}"
    wal, shared = (path.with_name(path.name + suffix) for suffix in ("-wal", "-shm"))
    had_index = path.exists()
    for old, kept in (
        (path, path.with_name(path.name + aside)),
        (wal, path.with_name(path.name + aside + "-wal")),
        (journal, journal.with_name(journal.name + aside)),
    ):
        with suppress(FileNotFoundError):
            os.link(old, kept)
    sync_directory(folder)
    # From here on the old index does not belong to the journal any more, and is refused.
    _building(journal).rename(journal)
    sync_directory(folder)
    # SQLite would write the old log into the new index.
    wal.unlink(missing_ok=True)
    shared.unlink(missing_ok=True)
    sync_directory(folder)
    _building(path).rename(path)
    sync_directory(folder)
    return str(path.with_name(path.name + aside)) if had_index else None


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
