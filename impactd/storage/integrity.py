"""Is the archive what it says it is? And: rebuild its index from the files."""

from __future__ import annotations

import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path

from impactd.storage import checksums
from impactd.storage.calibrations import CalibrationTable
from impactd.storage.diagnoses import DIAGNOSES_NAME, DiagnosisStore
from impactd.storage.drops import DropTable
from impactd.storage.errors import ArchiveError, CorruptShotError
from impactd.storage.index import Index
from impactd.storage.models import ModelTable
from impactd.storage.moment import utc_now
from impactd.storage.numbers import NumberSequence
from impactd.storage.problem import Problem
from impactd.storage.shot_store import FoundShot, ShotStore
from impactd.storage.shots import ShotTable

_SIDECARS = ("", "-wal", "-shm")
_KEPT_TABLES = (
    "calibrations",
    "drops",
    "fits",
    "jobs",
    "events",
    "tokens",
    "named_models",
    "active_models",
    "alarms",
)

_LOST_CALIBRATION = Problem(
    type="result-lost",
    title="Result lost with the index",
    status=500,
    detail="The index was rebuilt; the drops of this calibration are there, its result is not.",
    remedy="Run a new calibration.",
)


@dataclass(frozen=True)
class VerifyFinding:
    """What was found about one thing.

    Attributes
    ----------
    subject : str
        ``shot 17``, a file, or ``index``.
    problem : str or None
        What is wrong; ``None`` when it is sound.
    """

    subject: str
    problem: str | None


@dataclass(frozen=True)
class ReindexReport:
    """What a rebuilt index holds.

    Attributes
    ----------
    shots, drops : int
        Rows it holds now.
    damaged : tuple of str
        Files that could not be taken in, or are not what the old index had stored, and why.
    kept : dict
        Rows taken over from the old index, by table.
    lost : tuple of str
        Tables of the old index that could not be read in full.
    last_number : int
        The sequence goes on after it.
    old_index : str or None
        Where the old index was put.
    """

    shots: int
    drops: int
    damaged: tuple[str, ...]
    kept: dict[str, int]
    lost: tuple[str, ...]
    last_number: int
    old_index: str | None


def verify_archive(
    index: Index, store: ShotStore, diagnoses: DiagnosisStore
) -> Iterator[VerifyFinding]:
    """Check the index, every shot file and every diagnosis; nothing is changed.

    Parameters
    ----------
    index : Index
        The index.
    store : ShotStore
        The files.
    diagnoses : DiagnosisStore
        Their files.

    Yields
    ------
    VerifyFinding
        One for the index, one for each shot, one for each file that belongs to no shot, one for
        each diagnosis.
    """
    wrong = "; ".join(index.problems())
    yield VerifyFinding("index", f"{index.path}: {wrong}" if wrong else None)
    try:
        numbers = [int(row[0]) for row in index.rows("SELECT number FROM shots ORDER BY number")]
        yield from _shots(index, store, numbers)
        yield from _drops_without_shot(index)
    except ArchiveError as error:
        numbers = []
        yield VerifyFinding("index", str(error))
    known = {store.path(number) for number in numbers}
    for path in store.paths():
        if path not in known:
            yield VerifyFinding(str(path), store.why_unknown(path))
    for path in store.drafts():
        yield VerifyFinding(str(path), "left by a writer that was killed; it can be deleted.")
    for findings in (
        NumberSequence(index, store.directory).findings(),
        CalibrationTable(index, store.directory / "calibrations").findings(),
        ModelTable(index, store.directory).findings(),
        diagnoses.findings(),
    ):
        try:
            for subject, problem in findings:
                yield VerifyFinding(subject, problem)
        except ArchiveError as error:
            yield VerifyFinding("index", str(error))


def _shots(index: Index, store: ShotStore, numbers: list[int]) -> Iterator[VerifyFinding]:
    table = ShotTable(index)
    for number in numbers:
        try:
            store.read(table.get(number))
        except ArchiveError as error:
            yield VerifyFinding(f"shot {number}", str(error))
        else:
            yield VerifyFinding(f"shot {number}", None)


def _drops_without_shot(index: Index) -> Iterator[VerifyFinding]:
    for row in index.rows(
        "SELECT number FROM drops WHERE state IN ('stored', 'analysed') "
        "AND number NOT IN (SELECT number FROM shots)"
    ):
        yield VerifyFinding(f"drop {row[0]}", "is stored, and its shot is not in the index.")


def rebuild_index(path: Path, store: ShotStore) -> ReindexReport:
    """Rebuild an index from the files, with what the old one still gives.

    Drops, shots, calibrations, diagnoses, named models and which one is active come from the
    files. Fits, waiting jobs, events and tokens are in none: they are taken over from the old index
    as far as it can be read. The old index is kept under another name.

    Parameters
    ----------
    path : Path
        The index; may be absent or damaged.
    store : ShotStore
        The files.

    Returns
    -------
    ReindexReport
        What the new index holds.
    """
    old_path = _put_aside(path)
    with closing(Index(path)) as index:
        sequence = NumberSequence(index, store.directory)
        kept: dict[str, int] = {}
        lost: list[str] = []
        stored_hashes: dict[int, str] = {}
        if old_path is not None:
            stored_hashes = _take_over(index, old_path, kept, lost, sequence)
        calibrations = CalibrationTable(index, store.directory / "calibrations")
        kept["calibration files"], damaged = calibrations.restore()
        diagnoses = DiagnosisStore(index, store.directory / DIAGNOSES_NAME)
        kept["diagnosis files"], refused = diagnoses.restore()
        damaged += refused
        try:
            kept["active_models file"] = ModelTable(index, store.directory).restore_choices()
        except ArchiveError as error:
            damaged.append(str(error))
        with index.transaction():
            for file in store.paths():
                try:
                    _take_in(index, store.find(file), stored_hashes, damaged)
                except CorruptShotError as error:
                    damaged.append(str(error))
        if old_path is not None:
            kept["fits"] = _copy(index, old_path, "fits", lost)
        highest = index.number("SELECT max(number) FROM drops")
        sequence.raise_to(max(store.highest_number(), highest))
        return ReindexReport(
            shots=index.number("SELECT count(*) FROM shots"),
            drops=index.number("SELECT count(*) FROM drops"),
            damaged=tuple(damaged),
            kept=kept,
            lost=tuple(lost),
            last_number=sequence.last(),
            old_index=None if old_path is None else str(old_path),
        )


def _put_aside(path: Path) -> Path | None:
    if not path.exists():
        return None
    aside = path.with_name(f"{path.name}.before-{utc_now().replace(':', '')}")
    for suffix in _SIDECARS:
        sidecar = path.with_name(path.name + suffix)
        if sidecar.exists():
            shutil.move(sidecar, aside.with_name(aside.name + suffix))
    return aside


def _take_over(
    index: Index, old_path: Path, kept: dict[str, int], lost: list[str], sequence: NumberSequence
) -> dict[int, str]:
    """Copy what the files do not hold; return the hashes the old index had stored."""
    for table in _KEPT_TABLES:
        if table != "fits":  # they refer to shots, which come later
            kept[table] = _copy(index, old_path, table, lost)
    for row in _read(old_path, "sequence", lost):
        sequence.raise_to(int(row["last"]))
    return {int(row["number"]): str(row["sha256"]) for row in _read(old_path, "shots", lost)}


def _copy(index: Index, old_path: Path, table: str, lost: list[str]) -> int:
    copied = 0
    for row in _read(old_path, table, lost):
        names = row.keys()[:-1]
        marks = ", ".join("?" * len(names))
        try:
            index.write(f"INSERT INTO {table} ({', '.join(names)}) VALUES ({marks})", row[:-1])  # noqa: S608 - names of our tables
            copied += 1
        except ArchiveError:
            if table not in lost:
                lost.append(table)
    return copied


def _read(old_path: Path, table: str, lost: list[str]) -> list[sqlite3.Row]:
    """Return the rows of a table as far as a damaged file gives them."""
    rows: list[sqlite3.Row] = []
    try:
        with closing(sqlite3.connect(old_path)) as connection:
            connection.row_factory = sqlite3.Row
            changed = _changed(connection, table)
            found = connection.execute(f"SELECT *, rowid AS row_of_table FROM {table}")  # noqa: S608 - our tables
            for row in found:  # not at once: what came before a broken page is kept
                if row["row_of_table"] not in changed:
                    rows.append(row)  # noqa: PERF401 - a list made at once would lose them all
            if changed and table not in lost:
                lost.append(table)
    except (sqlite3.Error, UnicodeDecodeError):  # a message that quotes a damaged name is no text
        if table not in lost:
            lost.append(table)
    return rows


def _changed(connection: sqlite3.Connection, table: str) -> set[int]:
    """Return the rows that must not be taken over: nobody wrote them so."""
    known = "SELECT 1 FROM sqlite_master WHERE name='row_digests'"
    if connection.execute(known).fetchone() is None:  # an index of an older version
        return set()
    return set(checksums.changed_rows(connection, table))


def _take_in(
    index: Index, found: FoundShot, stored_hashes: dict[int, str], damaged: list[str]
) -> None:
    number = found.row.number
    stored = stored_hashes.get(number, found.row.sha256)
    if stored != found.row.sha256:
        # The old hash stays, so that reading the shot goes on being refused.
        damaged.append(f"Shot {number} is not the file that was stored: its SHA-256 differs.")
    ShotTable(index).add(replace(found.row, sha256=stored))
    drop = found.drop
    if drop is None:
        return
    if drop.calibration is not None:
        index.write(
            "INSERT OR IGNORE INTO calibrations (number, plan, owner, state, problem, "
            "requested_utc) VALUES (?, '[]', ?, 'failed', ?, ?)",
            (drop.calibration, drop.owner, _LOST_CALIBRATION.to_text(), drop.requested_utc),
        )
    kept = index.row("SELECT state FROM drops WHERE number=?", (number,))
    if kept is None or kept["state"] not in ("stored", "analysed"):
        DropTable(index).restore(drop)
