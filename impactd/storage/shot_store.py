"""The shot files of an archive: published once, checked on every read."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from impactd.storage.drops import Drop
from impactd.storage.errors import ArchiveError, CorruptShotError
from impactd.storage.publish import publish, sync_directory
from impactd.storage.regular_file import IrregularFileError, read_regular_file
from impactd.storage.sample_file import MAX_SAMPLES
from impactd.storage.shot_file import build_shot_file, read_shot_file
from impactd.storage.shot_metadata import Recording, ShotMetadata, StoredShot
from impactd.storage.shots import Shot
from impactd.storage.timestamp import utc_now

SHOTS_NAME = "shots"
PARTIAL_NAME = "partial"
SHOT_LIMIT_BYTES = 2 * 8 * MAX_SAMPLES + 64 * 1024 * 1024
"""Samples and their times at 8 bytes each, and a configuration of any length. [B]"""


@dataclass(frozen=True)
class FoundShot:
    """A shot file as found on disk, whatever the index says."""

    row: Shot
    """The row that the file deserves."""
    drop: Drop | None


class ShotStore:
    """The shot files of an archive."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def path(self, number: int) -> Path:
        """Return where the file of a number is, or would be."""
        return self.directory / SHOTS_NAME / f"{number:06d}.h5"

    def partial_path(self, number: int) -> Path:
        """Return where the evidence of a failed record is, or would be."""
        return self.directory / PARTIAL_NAME / f"{number:06d}.h5"

    def paths(self) -> list[Path]:
        """Return all shot files in the order of their numbers."""
        return sorted((self.directory / SHOTS_NAME).glob("*.h5"))

    def drafts(self) -> list[Path]:
        """Return temporary files of a killed writer."""
        return sorted(self.directory.glob("**/.*.draft"))

    def sync_names(self) -> None:
        """Let the names of all shot files survive a power cut; raise ArchiveError."""
        try:
            sync_directory(self.directory / SHOTS_NAME)
        except OSError as error:
            raise ArchiveError(
                f"The disk of {self.directory} does not write: {error.strerror}.",
                remedy="Check the disk (`dmesg`), then start the daemon again.",
            ) from error

    def highest_number(self) -> int:
        """Return the highest number any file carries, shots and evidence alike."""
        stems = [path.stem for path in self.directory.glob("*/*.h5")]
        return max((int(stem) for stem in stems if stem.isdigit()), default=0)

    def publish(
        self, number: int, recording: Recording, metadata: ShotMetadata, drop: Drop | None
    ) -> Shot:
        """Write the file of a shot, durably, and return its row."""
        content = build_shot_file(number, recording, metadata, drop)
        publish(self.path(number), content)
        return _row(number, content, recording, metadata)

    def publish_partial(
        self, number: int, recording: Recording, metadata: ShotMetadata, drop: Drop
    ) -> Path:
        """Write evidence of a record that must not be used, durably."""
        path = self.partial_path(number)
        publish(path, build_shot_file(number, recording, metadata, drop), replace=True)
        return path

    def take(self, path: Path, number: int) -> None:
        """Publish a shot file of this number from `rescue.find`, then remove it there.

        Raises
        ------
        CorruptShotError
            If it is no such file.
        ArchiveError
            If the archive still has no room.
        """
        content = _content(path)
        if read_shot_file(content, str(path))[0] != number:
            raise CorruptShotError(str(path), f"it does not hold shot {number}")
        publish(self.path(number), content)
        path.unlink(missing_ok=True)

    def read(self, shot: Shot) -> StoredShot:
        """Return a shot from its file.

        Raises CorruptShotError if the file is missing, or has another SHA-256 than was stored.
        """
        path = self.directory / shot.file
        return replace(read_shot(path, shot.sha256), shot=shot)

    def find(self, path: Path) -> FoundShot:
        """Return what a shot file says of itself; for rebuilding the index.

        Raises CorruptShotError if it is no shot file, or carries another number than its name.
        """
        content = _content(path)
        number, recording, metadata, drop = read_shot_file(content, str(path))
        if path != self.path(number):
            raise CorruptShotError(str(path), f"it holds shot {number}")
        return FoundShot(_row(number, content, recording, metadata), drop)

    def why_unknown(self, path: Path) -> str:
        """Return what to do about a file in ``shots`` that the index does not know."""
        try:
            self.find(path)
        except CorruptShotError as error:
            return f"no row in the index, and it is no shot: {error.reason}. Move it away."
        return "no row in the index; `impactd reindex` takes it in."


def read_shot(path: Path, sha256: str) -> StoredShot:
    """Return a shot from its file, with the row that it deserves, without an index; for workers.

    Raises CorruptShotError if the file is missing or does not hash to ``sha256``.
    """
    content = _content(path)
    found = hashlib.sha256(content).hexdigest()
    if found != sha256:
        raise CorruptShotError(
            str(path), f"its SHA-256 is {found[:12]}..., the index says {sha256[:12]}..."
        )
    number, recording, metadata, drop = read_shot_file(content, str(path))
    return StoredShot(_row(number, content, recording, metadata), recording, metadata, drop)


def _content(path: Path) -> bytes:
    try:
        return read_regular_file(path, SHOT_LIMIT_BYTES)
    except IrregularFileError as error:
        raise CorruptShotError(str(path), f"it {error.strerror}") from error
    except (OSError, ValueError) as error:  # a name with a zero byte in it is a ValueError
        reason = getattr(error, "strerror", None) or str(error)
        raise CorruptShotError(str(path), f"it cannot be read ({reason})") from error


def _row(number: int, content: bytes, recording: Recording, metadata: ShotMetadata) -> Shot:
    return Shot(
        number=number,
        file=f"{SHOTS_NAME}/{number:06d}.h5",
        sha256=hashlib.sha256(content).hexdigest(),
        size_bytes=len(content),
        source=metadata.source,
        origin=metadata.origin,
        started_utc=metadata.started_utc,
        stored_utc=utc_now(),
        sphere=None if metadata.sphere is None else metadata.sphere.name,
        surface=None if metadata.surface is None else metadata.surface.name,
        drop_height_m=metadata.drop_height_m,
        operator=metadata.operator,
        quantity=recording.quantity,
        sample_rate_hz=recording.sample_rate_hz,
        samples=recording.samples.size,
        trigger_index=recording.trigger_index,
        peak=_peak(recording),
        clipped=recording.clipped,
        environment=metadata.environment,
    )


def _peak(recording: Recording) -> float:
    samples = recording.samples
    before = samples[: recording.trigger_index // 2]
    baseline = float(np.median(before)) if before.size else 0.0
    extremes = (float(samples.max()) - baseline, float(samples.min()) - baseline)
    return max(extremes, key=abs) * recording.per_code
