"""Diagnoses as files: what was found, and the model that was named for it, outlive the index.

::

    DIRECTORY/diagnoses/000005.json    {"sha256": of the record's text, "record": {"format", "job",
                                       "named_model"}}; one per finished diagnosis, never changed
    DIRECTORY/active-models.json       which model was chosen when

Fits are not kept so: shots and named models are, and from them any fit can be made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from impactd.aliases import Json
from impactd.storage.errors import ArchiveError
from impactd.storage.index import Index, as_text
from impactd.storage.jobs import DIAGNOSE, Job, JobTable
from impactd.storage.models import ModelTable, NamedModel
from impactd.storage.publish import publish
from impactd.storage.regular_file import read_regular_file
from impactd.storage.sealed import SEALED_LIMIT_BYTES

FORMAT = "impactd-diagnosis-record/1"
DIAGNOSES_NAME = "diagnoses"


class DiagnosisStore:
    """The files of diagnoses, and their way back into the index."""

    def __init__(self, index: Index, directory: Path) -> None:
        self._index = index
        self._directory = directory

    def path(self, number: int) -> Path:
        """Return where the file of a diagnosis is, or would be."""
        return self._directory / f"{number:06d}.json"

    def paths(self) -> list[Path]:
        """Return all files in the order of their numbers."""
        return sorted(self._directory.glob("[0-9]*.json"))

    def publish(self, job: Job, model: NamedModel | None) -> Path:
        """Write a finished diagnosis durably, in the transaction that finishes its job.

        ``model`` is what was named for it. Raises ArchiveError if it cannot be written; the
        transaction then leaves nothing behind.
        """
        record = {
            "format": FORMAT,
            "job": asdict(job),
            "named_model": None if model is None else asdict(model),
        }
        path = self.path(job.id)
        # A daemon killed between file and commit makes the diagnosis again, hence `replace`.
        publish(path, as_text({"sha256": _digest(record), "record": record}).encode(), replace=True)
        return path

    def read(self, path: Path) -> Json:
        """Return the record of a file: ``format``, ``job`` and ``named_model``.

        Raises ArchiveError if it is not what was written.
        """
        try:
            kept = json.loads(read_regular_file(path, SEALED_LIMIT_BYTES))
            record: Json = kept["record"]
            sound = _digest(record) == kept["sha256"] and record["format"] == FORMAT
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise ArchiveError(
                f"The diagnosis {path} cannot be read: {error!r}.",
                remedy="Restore it from a backup, or diagnose its shots again.",
            ) from error
        if not sound:
            raise ArchiveError(
                f"The diagnosis {path} is not what was written: its SHA-256 differs.",
                remedy="Restore it from a backup, or diagnose its shots again.",
            )
        return record

    def restore(self) -> tuple[int, list[str]]:
        """Take in what the index lacks, and write files for diagnoses that only the index has.

        Return how many were taken in, and which files could not be, and why. Their numbers are not
        given out again all the same.
        """
        taken, damaged = 0, []
        for path in self.paths():
            try:
                record = self.read(path)
            except ArchiveError as error:
                damaged.append(str(error))
                self._never_again(path)
                continue
            taken += self._take_in(record)
        self._write_missing()
        return taken, damaged

    def findings(self) -> Iterator[tuple[str, str | None]]:
        """Yield what each file is about and what is wrong with it, ``None`` where it is sound."""
        for path in self.paths():
            subject = f"diagnosis {path.stem.lstrip('0')}"
            try:
                number = int(self.read(path)["job"]["id"])
            except ArchiveError as error:
                yield subject, str(error)
                continue
            row = self._index.row("SELECT state FROM jobs WHERE id=?", (number,))
            known = row is not None and row["state"] == "done"
            missing = "no row in the index; `impactd reindex` takes it in."
            yield subject, None if known else missing

    def _take_in(self, record: Json) -> bool:
        job, model = record["job"], record["named_model"]
        with self._index.transaction():
            row = self._index.row("SELECT state FROM jobs WHERE id=?", (job["id"],))
            new = row is None or row["state"] != "done"
            if new:
                self._index.write(
                    "INSERT OR REPLACE INTO jobs (id, kind, subject, payload, key, state, "
                    "attempts, result, reason, created_utc, started_utc, finished_utc) "
                    "VALUES (?, ?, ?, ?, ?, 'done', ?, ?, ?, ?, ?, ?)",
                    (
                        job["id"],
                        job["kind"],
                        job["subject"],
                        as_text(job["payload"]),
                        job["key"],
                        job["attempts"],
                        as_text(job["result"]),
                        job["reason"],
                        job["created_utc"],
                        job["started_utc"],
                        job["finished_utc"],
                    ),
                )
            if model is not None:
                self._index.write(
                    "INSERT OR IGNORE INTO named_models VALUES (?, ?, ?, ?, ?)",
                    (
                        model["name"],
                        model["version"],
                        as_text(model["definition"]),
                        as_text(model["provenance"]),
                        model["created_utc"],
                    ),
                )
        return new

    def _never_again(self, path: Path) -> None:
        """Reserve the number of a file that cannot be read, so that it is not given out again."""
        number = int(path.stem)
        with self._index.transaction():
            self._index.write(
                "INSERT INTO sqlite_sequence (name, seq) SELECT 'jobs', 0 "
                "WHERE NOT EXISTS (SELECT 1 FROM sqlite_sequence WHERE name='jobs')"
            )
            self._index.write(
                "UPDATE sqlite_sequence SET seq=max(seq, ?) WHERE name='jobs'", (number,)
            )

    def _write_missing(self) -> None:
        rows = self._index.rows("SELECT id FROM jobs WHERE kind=? AND state='done'", (DIAGNOSE,))
        jobs, models = JobTable(self._index), ModelTable(self._index, self._directory.parent)
        for row in rows:
            if self.path(row["id"]).exists():
                continue
            job = jobs.get(row["id"])
            named = (job.result or {}).get("model")
            model = models.named(named["name"], named["version"]) if named else None
            self.publish(job, model)


def _digest(record: Json) -> str:
    return hashlib.sha256(as_text(record).encode()).hexdigest()
