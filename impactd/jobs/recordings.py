"""Recordings that somebody uploads: kept by name, read by the code of `impactd new`, diagnosed.

::

    DIRECTORY/recordings/NAME/
      files/drop-1.csv          as it came, never changed
      choices.json, values.json what was stated last
      drops.csv                 the table of drops that was stated last
      recordings.png            the hits that the last reading found
      reading/3f2a5b.../        the campaign folder that the last reading made
      campaigns/3f2a5b.../      one for each diagnosis, never changed
"""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impactd.aliases import Json
from impactd.importing.errors import RecordingError
from impactd.importing.stated_values import read_drops
from impactd.jobs.errors import TaskError, TaskMemoryError, TaskTimeoutError
from impactd.jobs.worker_process import WorkerLimits, run_apart
from impactd.storage.archive import Archive
from impactd.storage.errors import InUseError, NotFoundError
from impactd.storage.jobs import DIAGNOSE, Job
from impactd.storage.publish import publish
from impactd.storage.recording_files import HDF5_ENDINGS, RECORDING_ENDINGS, RECORDINGS_NAME

FILES_NAME = "files"
VALUES_NAME = "values.json"
CHOICES_NAME = "choices.json"
PICTURE_NAME = "recordings.png"
DROPS_NAME = "drops.csv"
READING_NAME = "reading"
CAMPAIGNS_NAME = "campaigns"
MOST_FILES = 200
"""Of a set. A choice: nearly four of the usual campaigns of 54 drops."""
READ_LIMIT_S = 60.0
"""For all files of a set. Measured: the largest that may be uploaded takes 0.9 s."""
ENDINGS = (*(one for one in RECORDING_ENDINGS if one not in {*HDF5_ENDINGS, ".mat"}), ".gz")
"""Of files that may be uploaded. HDF5, which a MATLAB file may be, can point to other files of this
computer."""
_SHELL = "Use `impactd new` on the computer that has it."


@dataclass(frozen=True)
class RecordingSet:
    """Files that were recorded together."""

    name: str
    folder: Path
    files: tuple[Path, ...]
    """In the order of their names; numbers in them count as numbers."""

    @property
    def picture(self) -> Path:
        """Return where the picture of the last reading is, or would be."""
        return self.folder / PICTURE_NAME

    def stated(self) -> tuple[Json, Json | None]:
        """Return the choices and the values that were stated last."""
        return _json(self.folder / CHOICES_NAME) or {}, _json(self.folder / VALUES_NAME)


class RecordingSets:
    """The recordings of the data folder. Thread safe, but for two readings of one set.

    ``stop`` ends a reading that is under way.
    """

    def __init__(self, archive: Archive, memory_bytes: int, stop: threading.Event) -> None:
        self._archive = archive
        self._directory = archive.directory / RECORDINGS_NAME
        self._limits = WorkerLimits(READ_LIMIT_S, memory_bytes)
        self._stop = stop

    def all(self) -> list[RecordingSet]:
        """Return every set, the newest first."""
        folders = {file.parent.parent for file in self._directory.glob(f"*/{FILES_NAME}/[!.]*")}
        newest_first = sorted(folders, key=lambda one: one.stat().st_mtime, reverse=True)
        return [self.get(one.name) for one in newest_first]

    def get(self, name: str) -> RecordingSet:
        """Return a set; raise NotFoundError if nobody uploaded anything to it."""
        folder = self._directory / name
        files = [one for one in (folder / FILES_NAME).glob("*") if one.name[0] != "."]
        if not files:
            raise NotFoundError("recording set", name)
        return RecordingSet(name, folder, tuple(sorted(files, key=_natural)))

    def keep(self, name: str, file: str, content: bytes) -> None:
        """Keep a file durably; the same one may come again.

        Raises
        ------
        RecordingError
            If it cannot be a recording, or another file of this name is there.
        ArchiveError
            If the disk does not take it.
        """
        if Path(file).suffix.lower() not in ENDINGS:
            raise RecordingError(
                file,
                f"has none of the endings {', '.join(ENDINGS)}.",
                f"Export it as text, time and signal in columns. {_SHELL}",
            )
        if not content:
            raise RecordingError(file, "is empty.", "Export it again.")
        folder = self._directory / name / FILES_NAME
        path = folder / file
        if path.exists():
            if path.read_bytes() != content:
                raise RecordingError(
                    file,
                    f"is in {name} already, with another content, and nothing is overwritten.",
                    "Rename the file, or upload it under another name of recordings.",
                )
            return
        if folder.is_dir() and len(list(folder.iterdir())) >= MOST_FILES:
            raise RecordingError(file, f"is more than the {MOST_FILES} files of a set.", _SHELL)
        self._archive.check_space()
        folder.mkdir(mode=0o750, parents=True, exist_ok=True)
        publish(path, content)

    def keep_drops(self, name: str, content: bytes) -> Json:
        """Take a table of drops into what is stated of a set; return the values.

        It is that of `impactd new --drops`; what was stated of these drops before is replaced.

        Raises
        ------
        NotFoundError
            If nobody uploaded a recording to the set.
        RecordingError
            If it is no such table.
        """
        folder = self.get(name).folder
        publish(folder / DROPS_NAME, content, replace=True)
        try:
            drops = read_drops(folder / DROPS_NAME)
        except RecordingError as error:
            where = error.where.replace(str(folder / DROPS_NAME), "The table of drops")
            raise RecordingError(where, error.what, error.remedy) from error
        values: Json = _json(folder / VALUES_NAME) or {}
        values["shots"] = {**values.get("shots", {}), **drops}
        for key, group in (("sphere", "spheres"), ("surface", "surfaces")):
            named: Json = {drop[key]: {} for drop in drops.values() if key in drop}
            values[group] = {**named, **values.get(group, {})}  # of which nothing is known yet
        _state(folder / VALUES_NAME, values)
        return values

    def delete(self, name: str) -> None:
        """Delete a set with its files and campaign folders; documents of diagnoses stay.

        Raises
        ------
        NotFoundError
            If there is none.
        InUseError
            If a diagnosis of it waits or runs.
        """
        folder = self.get(name).folder
        for state in ("queued", "running"):
            for job in self._archive.jobs.list(state=state, kind=DIAGNOSE, limit=None):
                if job.payload.get(RECORDINGS_NAME) == name:
                    raise InUseError(
                        f"The recordings {name} are being diagnosed (diagnosis {job.id}).",
                        remedy="Cancel the diagnosis, or wait for it; then delete them.",
                    )
        gone = folder.with_name(f".{name}.deleted")  # whole or not at all, whatever happens now
        shutil.rmtree(gone, ignore_errors=True)
        folder.rename(gone)
        shutil.rmtree(gone)

    def read(self, name: str, choices: Json, values: Json | None) -> Json:
        """Return ``shots``, ``assumptions`` and ``missing`` of a set; see `impactd new`.

        ``choices`` are those of `impactd.importing.choices.Choices`, and are kept with the values.
        Raises RecordingError if a file cannot be read or a value is impossible.
        """
        found = self.get(name)
        out = found.folder / READING_NAME / _digest(found, choices, values)
        shutil.rmtree(out.parent, ignore_errors=True)
        out.parent.mkdir(mode=0o750)
        return self._apart(found, choices, values, out)

    def request_diagnosis(
        self,
        name: str,
        choices: Json,
        values: Json | None,
        *,
        base: str | None,
        budget_s: float | None,
        key: str | None,
    ) -> Job:
        """Make a campaign folder of a set, and ask for a diagnosis of it.

        Raises
        ------
        RecordingError
            As `read`.
        IdempotencyConflictError
            If the key belongs to another request.
        """
        found = self.get(name)
        digest = _digest(found, choices, values)
        out, read = found.folder / CAMPAIGNS_NAME / digest, found.folder / READING_NAME / digest
        out.parent.mkdir(mode=0o750, exist_ok=True)
        if read.exists() and not out.exists():  # files are not read twice
            read.rename(out)
        if not out.exists():
            self._apart(found, choices, values, out)
        payload: Json = {
            RECORDINGS_NAME: name,
            "campaign": out.relative_to(self._archive.directory).as_posix(),
            "base": base,
            "budget_s": budget_s,
        }
        return self._archive.jobs.enqueue(DIAGNOSE, payload, f"the recordings {name}", key=key)

    def _apart(self, found: RecordingSet, choices: Json, values: Json | None, out: Path) -> Json:
        _state(found.folder / CHOICES_NAME, choices)
        if values is not None:
            _state(found.folder / VALUES_NAME, values)
        order = {
            "folder": str(found.folder.resolve()),
            "files": [one.name for one in found.files],
            "choices": choices,
            "has_values": values is not None,
            "out": str(out.resolve()),
        }
        try:
            made: Json = run_apart(
                "impactd.jobs.recording_tasks:read", [order], self._limits, self._stop
            )
        except TaskError as error:
            remedy = f"Upload less at a time. {_SHELL}"
            raise RecordingError(found.name, _why(error), remedy) from error
        if "refused" in made:
            raise RecordingError(**made["refused"])
        return made


def _digest(found: RecordingSet, choices: Json, values: Json | None) -> str:
    """Return a name for the campaign that files, choices and values make."""
    rest = [[one.name for one in found.files], choices, values]
    return hashlib.sha256(json.dumps(rest, sort_keys=True).encode()).hexdigest()[:16]


def _why(error: TaskError) -> str:
    if isinstance(error, TaskTimeoutError):
        return f"cannot be read within {READ_LIMIT_S:g} s."
    if isinstance(error, TaskMemoryError):
        return f"cannot be read within {error.limit_bytes / 1e6:.0f} MB (jobs.fit_memory_bytes)."
    return f"cannot be read: {error}"


def _state(path: Path, value: Json) -> None:
    publish(path, json.dumps(value, indent=1, ensure_ascii=False).encode(), replace=True)


def _json(path: Path) -> Json | None:
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else None


def _natural(path: Path) -> list[Any]:
    """Return a key that sorts drop-10 behind drop-2."""
    parts = re.split(r"(\d+)", path.name)
    return [(int(one), "") if one.isdecimal() else (-1, one) for one in parts]
