"""The archive: shot files that never change, and an index of them.

::

    DIRECTORY/
      index.sqlite      tables; can be rebuilt from the files
      last-number       highest number ever given out, so that a rebuilt index repeats none
      shots/000017.h5   one file per shot
      partial/          evidence of records that failed; never listed as shots
"""

from __future__ import annotations

import hashlib
import shutil
import sqlite3
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path

import numpy as np

from drivers.digitizer import Record
from impactd.storage.calibrations import Calibration, CalibrationTable
from impactd.storage.drops import ACTIVE_STATES, FINAL_STATES, Drop, DropRequest, DropTable
from impactd.storage.errors import (
    ArchiveError,
    CorruptShotError,
    DropStateError,
    IdempotencyConflictError,
    NotFoundError,
    StorageFullError,
)
from impactd.storage.events import Event, EventTable
from impactd.storage.fits import Fit, FitTable
from impactd.storage.index import Index
from impactd.storage.jobs import Job, JobTable
from impactd.storage.models import ModelTable
from impactd.storage.moment import utc_now
from impactd.storage.problem import Problem
from impactd.storage.publish import publish
from impactd.storage.shot_about import Recording, ShotAbout, StoredShot
from impactd.storage.shot_file import build_shot_file, read_shot_file, recording_of
from impactd.storage.shots import Shot, ShotTable
from impactd.storage.tokens import SCOPES, Token, TokenTable

__all__ = [
    "ACTIVE_STATES",
    "FINAL_STATES",
    "SCOPES",
    "Archive",
    "ArchiveError",
    "Calibration",
    "CorruptShotError",
    "Drop",
    "DropRequest",
    "DropStateError",
    "Event",
    "Fit",
    "IdempotencyConflictError",
    "Job",
    "NotFoundError",
    "Problem",
    "Recording",
    "Shot",
    "ShotAbout",
    "StorageFullError",
    "StoredShot",
    "Token",
]

INDEX_NAME = "index.sqlite"
LAST_NUMBER_NAME = "last-number"
SHOTS_NAME = "shots"
PARTIAL_NAME = "partial"


class Archive:
    """Drops, shots and everything that is known of them. Thread safe.

    Open it with `Archive.open`; close it when done, or use it as a context manager.

    Parameters
    ----------
    directory : Path
        Where it lives.
    index : Index
        Its open index.
    reserve_bytes : int
        What must stay free on the disk before a new drop may begin. [B]

    Attributes
    ----------
    jobs, fits, calibrations, events, tokens, models : table
        One table each; see their files.
    """

    def __init__(self, directory: Path, index: Index, *, reserve_bytes: int) -> None:
        self.directory = directory
        self.reserve_bytes = reserve_bytes
        self._index = index
        self._drops = DropTable(index)
        self._shots = ShotTable(index)
        self.jobs = JobTable(index)
        self.fits = FitTable(index)
        self.calibrations = CalibrationTable(index)
        self.events = EventTable(index)
        self.tokens = TokenTable(index)
        self.models = ModelTable(index)

    @classmethod
    def open(cls, directory: Path, *, reserve_bytes: int) -> Archive:
        """Open an archive, creating or migrating it; jobs of dead processes wait again.

        Parameters
        ----------
        directory : Path
            Created when absent.
        reserve_bytes : int
            What must stay free before a new drop may begin. [B]

        Returns
        -------
        Archive
            Ready to use.

        Raises
        ------
        ArchiveError
            If the directory or its index cannot be used.
        """
        try:
            for name in ("", SHOTS_NAME, PARTIAL_NAME):
                (directory / name).mkdir(mode=0o750, parents=True, exist_ok=True)
            index = Index(directory / INDEX_NAME)
        except (OSError, sqlite3.OperationalError) as error:
            raise ArchiveError(
                f"The archive {directory} cannot be opened: {error}.",
                remedy="Check storage.directory, its owner and its mode.",
            ) from error
        archive = cls(directory, index, reserve_bytes=reserve_bytes)
        try:
            archive.jobs.requeue_abandoned()
        except BaseException:
            archive.close()
            raise
        return archive

    def close(self) -> None:
        """Give the index back; nothing is lost without it."""
        self._index.close()

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Space

    def free_bytes(self) -> int:
        """Return what the disk still offers above the reserve; negative inside the reserve. [B]"""
        return shutil.disk_usage(self.directory).free - self.reserve_bytes

    def check_space(self) -> None:
        """Raise StorageFullError when the reserve would be touched; ask before arming."""
        free = shutil.disk_usage(self.directory).free
        if free < self.reserve_bytes:
            raise StorageFullError(
                str(self.directory), free_bytes=free, needed_bytes=self.reserve_bytes
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
        """Give a drop its number and its row, durably, before anything moves.

        Parameters
        ----------
        request : DropRequest
            What was asked for.
        owner : str
            Who asked.
        idempotency_key : str, optional
            The client's key: the same key with the same request gives the old drop.
        calibration : int, optional
            The calibration run it belongs to.

        Returns
        -------
        tuple of Drop and bool
            The drop, and whether it was created now.

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
                self._next_number(),
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
        """Move a drop on, durably; raise DropStateError when it has ended."""
        return self._drops.set_state(number, state, problem)

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
        """End what a dead daemon left under way; the daemon calls it at start-up.

        A drop whose file was published before the end is stored: its shot is taken into the index.
        Every other one is interrupted: shown, and never fired again.

        Returns
        -------
        list of Drop
            The drops that were under way, as they are now.
        """
        for draft in self.directory.glob("*/.*.draft"):
            draft.unlink(missing_ok=True)
        return [self._end_of_interrupted(drop) for drop in self._drops.active()]

    def _end_of_interrupted(self, drop: Drop) -> Drop:
        path = self._file(drop.number)
        if path.exists():
            try:
                self._adopt(path)
            except CorruptShotError as error:
                detail = str(error)
            else:
                return self._drops.get(drop.number)
        else:
            detail = f"The daemon ended while drop {drop.number} was {drop.state}."
        return self._drops.set_state(
            drop.number,
            "interrupted",
            Problem(
                type="interrupted",
                title="Drop interrupted",
                status=500,
                detail=detail,
                remedy="Check the rig, hang the sphere and ask for a new drop.",
            ),
        )

    # Shots

    def store_shot(self, number: int, record: Record, about: ShotAbout) -> Shot:
        """Store the record of a drop; return once it would survive a power cut.

        Parameters
        ----------
        number : int
            The drop; its shot gets the same number.
        record : Record
            As the digitizer gave it.
        about : ShotAbout
            The circumstances.

        Returns
        -------
        Shot
            Its row in the index; the drop is ``stored``.

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
        recording = recording_of(record)
        stored = replace(drop, state="stored", shot=number, updated_utc=utc_now())
        content = build_shot_file(number, recording, about, stored)
        publish(self._file(number), content)
        shot = self._row(number, content, recording, about)
        with self._index.transaction():
            self._shots.add(shot)
            self._drops.set_state(number, "stored")
        return shot

    def store_import(self, recording: Recording, about: ShotAbout) -> Shot:
        """Store a recording made elsewhere under the next number, durably."""
        with self._index.transaction():
            number = self._next_number()
        content = build_shot_file(number, recording, about, None)
        publish(self._file(number), content)
        shot = self._row(number, content, recording, about)
        self._shots.add(shot)
        return shot

    def keep_partial(self, number: int, record: Record, about: ShotAbout, reason: str) -> Path:
        """Keep a record that must not be used, as evidence beside the archive.

        Parameters
        ----------
        number : int
            The drop.
        record : Record
            What there is of it.
        about : ShotAbout
            The circumstances.
        reason : str
            Why it must not be used.

        Returns
        -------
        Path
            The file, below ``partial/``.
        """
        noted = replace(about, notes=(*about.notes, f"NOT A SHOT: {reason}"))
        content = build_shot_file(number, recording_of(record), noted, self._drops.get(number))
        path = self.directory / PARTIAL_NAME / f"{number:06d}.h5"
        publish(path, content, replace=True)
        return path

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
        limit: int = 50,
        before: int | None = None,
    ) -> list[Shot]:
        """Return shots, newest first; see `ShotTable.find`."""
        return self._shots.find(
            sphere=sphere, surface=surface, since=since, until=until, limit=limit, before=before
        )

    def shot_path(self, number: int) -> Path:
        """Return the file of a shot; raise NotFoundError."""
        return self.directory / self._shots.get(number).file

    def read_shot(self, number: int) -> StoredShot:
        """Return a shot from its file.

        Parameters
        ----------
        number : int
            The shot.

        Returns
        -------
        StoredShot
            Row, record and circumstances.

        Raises
        ------
        NotFoundError
            If there is none of that number.
        CorruptShotError
            If the file is missing, or its SHA-256 is not the one that was stored.
        """
        shot = self._shots.get(number)
        path = self.directory / shot.file
        try:
            content = path.read_bytes()
        except OSError as error:
            raise CorruptShotError(str(path), f"it cannot be read ({error.strerror})") from error
        found = hashlib.sha256(content).hexdigest()
        if found != shot.sha256:
            raise CorruptShotError(
                str(path), f"its SHA-256 is {found[:12]}..., the index says {shot.sha256[:12]}..."
            )
        _, recording, about, drop = read_shot_file(content, str(path))
        return StoredShot(shot, recording, about, drop)

    # Inside

    def _file(self, number: int) -> Path:
        return self.directory / SHOTS_NAME / f"{number:06d}.h5"

    def _next_number(self) -> int:
        """Draw a number; the caller's transaction makes the row, the file outlives the index."""
        with self._index.transaction():
            number = 1 + self._index.number("SELECT last FROM sequence WHERE name='drop'")
            publish(self.directory / LAST_NUMBER_NAME, f"{number}\n".encode(), replace=True)
            self._index.write("UPDATE sequence SET last=? WHERE name='drop'", (number,))
            return number

    def _row(self, number: int, content: bytes, recording: Recording, about: ShotAbout) -> Shot:
        return Shot(
            number=number,
            file=f"{SHOTS_NAME}/{number:06d}.h5",
            sha256=hashlib.sha256(content).hexdigest(),
            size_bytes=len(content),
            source=about.source,
            origin=about.origin,
            started_utc=about.started_utc,
            stored_utc=utc_now(),
            sphere=None if about.sphere is None else about.sphere.name,
            surface=None if about.surface is None else about.surface.name,
            drop_height_m=about.drop_height_m,
            operator=about.operator,
            quantity=recording.quantity,
            sample_rate_hz=recording.sample_rate_hz,
            samples=recording.samples.size,
            trigger_index=recording.trigger_index,
            peak=_peak(recording),
            clipped=recording.clipped,
        )

    def _adopt(self, path: Path) -> Shot:
        """Take a published file into the index, with its drop."""
        content = path.read_bytes()
        number, recording, about, drop = read_shot_file(content, str(path))
        shot = self._row(number, content, recording, about)
        with self._index.transaction():
            self._shots.add(shot)
            if drop is not None:
                self._drops.restore(drop)
        return shot


def _peak(recording: Recording) -> float:
    """Return the sample farthest from the baseline, baseline removed, in the signal's unit."""
    samples = recording.samples
    before = samples[: recording.trigger_index // 2]
    baseline = float(np.median(before)) if before.size else 0.0
    extremes = (float(samples.max()) - baseline, float(samples.min()) - baseline)
    return max(extremes, key=abs) * recording.per_code


def software() -> str:
    """Return program and version, as it goes into every file and result."""
    return f"impactd {version('impactd')}"
