"""The archive: shot files that never change, and an index of them.

::

    DIRECTORY/
      index.sqlite                 tables; can be rebuilt from journal and files
      journal.jsonl                every change of the tables, synced before it is told
      last-number                  highest number ever given out, so that none is given out again
      shots/000017.h5              one file per shot
      partial/000018.h5            evidence of records that failed; never listed as shots
      calibrations/000001.json     results of calibrations, for a rebuilt index
      diagnoses/000005.json        finished diagnoses and the models named for them, likewise
      active-models.json           which model was chosen when, likewise
      recordings/NAME/             what somebody uploaded, and the campaign folders made of it
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

from drivers.digitizer import Record
from impactd.storage import rescue
from impactd.storage.alarms import AlarmTable
from impactd.storage.calibrations import Calibration, CalibrationTable
from impactd.storage.comparisons import ComparisonTable
from impactd.storage.diagnoses import DIAGNOSES_NAME, DiagnosisStore
from impactd.storage.drops import ACTIVE_STATES, FINAL_STATES, Drop, DropRequest, DropTable
from impactd.storage.errors import (
    ArchiveError,
    CampaignError,
    CorruptShotError,
    DropStateError,
    IdempotencyConflictError,
    NotFoundError,
    StorageFullError,
)
from impactd.storage.events import Event, EventTable
from impactd.storage.exchange import ImportReport, export_shots, import_folder
from impactd.storage.fits import Fit, FitTable
from impactd.storage.index import Index
from impactd.storage.integrity import VerifyFinding, verify_archive
from impactd.storage.jobs import Job, JobTable
from impactd.storage.journal import JOURNAL_NAME
from impactd.storage.lock import lock_archive
from impactd.storage.models import ModelTable
from impactd.storage.numbers import LAST_NUMBER_NAME, NumberSequence
from impactd.storage.problem import Problem
from impactd.storage.publish import sync_directory
from impactd.storage.recovery import end_interrupted
from impactd.storage.reindex import ReindexReport, rebuild_index, remove_unfinished
from impactd.storage.shot_file import build_shot_file, recording_of
from impactd.storage.shot_metadata import Recording, ShotMetadata, StoredShot
from impactd.storage.shot_store import PARTIAL_NAME, SHOTS_NAME, ShotStore
from impactd.storage.shots import Shot, ShotTable
from impactd.storage.timestamp import utc_now
from impactd.storage.tokens import SCOPES, Token, TokenTable
from impactd.storage.version import software

__all__ = [
    "ACTIVE_STATES",
    "FINAL_STATES",
    "SCOPES",
    "Archive",
    "ArchiveError",
    "Calibration",
    "CampaignError",
    "CorruptShotError",
    "Drop",
    "DropRequest",
    "DropStateError",
    "Event",
    "Fit",
    "IdempotencyConflictError",
    "ImportReport",
    "Job",
    "NotFoundError",
    "Problem",
    "Recording",
    "ReindexReport",
    "Shot",
    "ShotMetadata",
    "StorageFullError",
    "StoredShot",
    "Token",
    "VerifyFinding",
    "software",
]

INDEX_NAME = "index.sqlite"
CALIBRATIONS_NAME = "calibrations"


class Archive:
    """Drops, shots and everything that is known of them. Thread safe.

    Open it with `Archive.open`; close it when done, or use it as a context manager. ``lock`` is the
    descriptor of the lock, held while the archive is open. Each table has a file of its own.
    """

    def __init__(
        self,
        directory: Path,
        index: Index,
        *,
        lock: int,
        reserve_bytes: int,
        rescue_directory: Path | None = None,
    ) -> None:
        self.directory = directory
        self.rescue_directory = rescue_directory
        self.reserve_bytes = reserve_bytes
        self._lock: int | None = lock
        self._index = index
        self._store = ShotStore(directory)
        self._numbers = NumberSequence(index, directory)
        self._drops = DropTable(index)
        self._shots = ShotTable(index)
        self.jobs = JobTable(index)
        self.fits = FitTable(index)
        self.calibrations = CalibrationTable(index, directory / CALIBRATIONS_NAME)
        self.events = EventTable(index)
        self.alarms = AlarmTable(index)
        self.comparisons = ComparisonTable(index)
        self.tokens = TokenTable(index)
        self.models = ModelTable(index, directory)
        self.diagnoses = DiagnosisStore(index, directory / DIAGNOSES_NAME)

    @classmethod
    def open(
        cls, directory: Path, *, reserve_bytes: int, rescue_directory: Path | None = None
    ) -> Archive:
        """Open an archive, creating or migrating it; jobs of dead processes wait again.

        Parameters
        ----------
        reserve_bytes : int
            What must stay free before a new drop may begin. [B]
        rescue_directory : Path or None
            Where a record goes that this disk does not take when the daemon must end.

        Raises
        ------
        ArchiveError
            If the directory or its index cannot be used.
        """
        _make_folders(directory)
        path = directory / INDEX_NAME
        if not path.exists() and _is_old(directory):
            raise ArchiveError(
                f"The index {path} is gone, and the archive is not new.",
                remedy="Run `impactd reindex`: it rebuilds the index from journal and files.",
            )
        lock = lock_archive(directory, alone=False)
        try:
            archive = cls(
                directory,
                Index(path),
                lock=lock,
                reserve_bytes=reserve_bytes,
                rescue_directory=rescue_directory,
            )
            remove_unfinished(path)  # of a rebuild that was killed: none runs beside this lock
        except BaseException:
            os.close(lock)
            raise
        try:
            archive.jobs.requeue_abandoned()
        except BaseException:
            archive.close()
            raise
        return archive

    @classmethod
    def reindex(cls, directory: Path) -> ReindexReport:
        """Rebuild the index from journal and files; see `reindex.rebuild_index`.

        Raises ArchiveError if another process has the archive open.
        """
        _make_folders(directory)
        lock = lock_archive(directory, alone=True)
        try:
            return rebuild_index(directory / INDEX_NAME, ShotStore(directory))
        finally:
            os.close(lock)

    def close(self) -> None:
        """Close the index and release the lock; nothing is lost without it."""
        self._index.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def transaction(self) -> AbstractContextManager[None]:
        """Let several changes become durable together, or not at all."""
        return self._index.transaction()

    # Space

    def free_bytes(self) -> int:
        """Return what the disk still offers above the reserve; negative inside the reserve. [B]"""
        return shutil.disk_usage(self.directory).free - self.reserve_bytes

    def check_space(self) -> None:
        """Raise StorageFullError when the reserve would be touched; ask before arming."""
        above = self.free_bytes()
        if above < 0:
            raise StorageFullError(
                str(self.directory),
                free_bytes=above + self.reserve_bytes,
                needed_bytes=self.reserve_bytes,
            )

    # Drops

    def begin_drop(
        self,
        request: DropRequest,
        *,
        owner: str,
        idempotency_key: str | None = None,
        calibration: int | None = None,
    ) -> tuple[Drop, bool]:
        """Write a drop's number and row, durably, before anything moves.

        Return it, and whether it was created now: the same ``idempotency_key`` (with its namespace,
        see `request_key`) and request give the old drop. ``calibration`` is the run it belongs to.

        Raises
        ------
        IdempotencyConflictError
            If the key belongs to another request.
        StorageFullError
            If the disk is full.
        """
        with self._index.transaction():
            if idempotency_key is not None:
                old = self._drops.by_key(idempotency_key, request)
                if old is not None:
                    return old, False
            drop = self._drops.begin(
                self._numbers.draw(),
                request,
                owner=owner,
                idempotency_key=idempotency_key,
                calibration=calibration,
            )
        return drop, True

    def drop_by_key(self, idempotency_key: str, request: DropRequest) -> Drop | None:
        """Return the drop of a key, ``None`` when it is new; raise IdempotencyConflictError."""
        return self._drops.by_key(idempotency_key, request)

    def set_drop_state(self, number: int, state: str, problem: Problem | None = None) -> Drop:
        """Write a drop's next state, durably; raise DropStateError when it has ended."""
        return self._drops.set_state(number, state, problem)

    def set_rebound_height(self, number: int, rebound_height_m: float, u_m: float) -> Drop:
        """Write how high a drop's sphere came back [m], durably; raise NotFoundError."""
        return self._drops.set_rebound(number, rebound_height_m, u_m)

    def drop(self, number: int) -> Drop:
        """Return one drop; raise NotFoundError."""
        return self._drops.get(number)

    def drops(self, limit: int = 50, before: int | None = None) -> list[Drop]:
        """Return drops, newest first."""
        return self._drops.newest(limit=limit, before=before)

    def active_drops(self) -> list[Drop]:
        """Return the drops under way, oldest first."""
        return self._drops.active()

    def interrupt_unfinished(self) -> list[Drop]:
        """End the drops that a dead daemon left under way, and return them; called at start-up.

        A drop whose file was published before the end, or rescued to another disk, is stored: its
        shot is taken into the index. Every other one is interrupted: shown, and never fired again.
        """
        return end_interrupted(self._index, self._store, self.rescue_directory)

    # Shots

    def store_shot(self, number: int, record: Record, metadata: ShotMetadata) -> Shot:
        """Store the record of a drop; return once it would survive a power cut.

        The shot gets the drop's number, and the drop is ``stored``.

        Raises
        ------
        DropStateError
            If the drop has ended.
        StorageFullError
            If the disk is full; nothing is left behind.
        ArchiveError
            If the file cannot be written.
        """
        drop = self._drops.get(number)
        if drop.state in FINAL_STATES:
            raise DropStateError(number, drop.state, "stored")
        if self._store.path(number).exists():
            # An earlier try wrote the file and then the index had no room for its row.
            self._store.sync_names()
            shot = self._store.find(self._store.path(number)).row
        else:
            # The file remembers its drop as it will be once the file is there.
            stored = replace(drop, state="stored", shot=number, updated_utc=utc_now())
            shot = self._store.publish(number, recording_of(record), metadata, stored)
        with self._index.transaction():
            self._shots.add(shot)
            self._drops.set_state(number, "stored")
        return shot

    def rescue_shot(self, number: int, record: Record, metadata: ShotMetadata) -> Path:
        """Keep a record outside the archive that cannot be stored before the daemon ends.

        The drop stays under way: `interrupt_unfinished` of the next start takes its file back.
        Raises ArchiveError if no disk took it.
        """
        path = self._store.path(number)
        if path.exists():  # only its row is missing
            return path
        drop = replace(self._drops.get(number), state="stored", shot=number, updated_utc=utc_now())
        content = build_shot_file(number, recording_of(record), metadata, drop)
        return rescue.keep(self.directory, number, content, self.rescue_directory)

    def store_import(self, recording: Recording, metadata: ShotMetadata) -> Shot:
        """Store a recording made elsewhere under the next number, durably."""
        number = self._numbers.draw()
        shot = self._store.publish(number, recording, metadata, None)
        self._shots.add(shot)
        return shot

    def keep_partial(
        self, number: int, record: Record, metadata: ShotMetadata, reason: str
    ) -> Path:
        """Keep a record that must not be used, as evidence in ``partial/``; ``reason`` says why."""
        noted = replace(metadata, notes=(*metadata.notes, f"NOT A SHOT: {reason}"))
        drop = self._drops.get(number)
        return self._store.publish_partial(number, recording_of(record), noted, drop)

    def shot(self, number: int) -> Shot:
        """Return one row; raise NotFoundError."""
        return self._shots.get(number)

    def shots(
        self,
        *,
        sphere: str | None = None,
        surface: str | None = None,
        since: str | None = None,
        until: str | None = None,
        search: str | None = None,
        limit: int = 50,
        before: int | None = None,
    ) -> list[Shot]:
        """Return shots, newest first; see `ShotTable.find`."""
        return self._shots.find(
            sphere=sphere,
            surface=surface,
            since=since,
            until=until,
            search=search,
            limit=limit,
            before=before,
        )

    def shot_path(self, number: int) -> Path:
        """Return the file of a shot; raise NotFoundError."""
        return self.directory / self._shots.get(number).file

    def read_shot(self, number: int) -> StoredShot:
        """Return a shot from its file.

        Raises
        ------
        NotFoundError
            If the index has no such shot.
        CorruptShotError
            If the file is missing, or its SHA-256 is not the one that was stored.
        """
        return self._store.read(self._shots.get(number))

    # In and out

    def import_campaign(self, path: Path) -> ImportReport:
        """Import a campaign folder; the same samples are stored once. See `import_folder`."""
        return import_folder(path, known=self._shots.by_origin, store=self.store_import)

    def export(self, numbers: Sequence[int], form: str, out: Path) -> list[Path]:
        """Write shots as ``csv``, ``npz`` or ``campaign`` into a directory; see `export_shots`."""
        return export_shots([self.read_shot(number) for number in numbers], form, out)

    def verify(self) -> Iterator[VerifyFinding]:
        """Check the index, every shot file and every diagnosis; see `verify_archive`."""
        return verify_archive(self._index, self._store, self.diagnoses)


def is_archive(directory: Path) -> bool:
    """Return whether a folder holds an archive, be it without its index."""
    return (directory / SHOTS_NAME).is_dir() or _is_old(directory)


def _is_old(directory: Path) -> bool:
    return any((directory / name).exists() for name in (LAST_NUMBER_NAME, JOURNAL_NAME))


def _make_folders(directory: Path) -> None:
    try:
        new = not (directory / SHOTS_NAME).exists()
        for name in ("", SHOTS_NAME, PARTIAL_NAME, CALIBRATIONS_NAME, DIAGNOSES_NAME):
            (directory / name).mkdir(mode=0o750, parents=True, exist_ok=True)
        if new:  # else a power cut could take the archive itself, with the first shots in it
            sync_directory(directory)
            sync_directory(directory.absolute().parent)
    except OSError as error:
        raise ArchiveError(
            f"The archive {directory} cannot be made: {error.strerror}.",
            remedy="Check storage.directory, its owner and its mode.",
        ) from error
