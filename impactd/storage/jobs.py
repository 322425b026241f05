"""The table of jobs: fits that wait, run, are done or failed, across restarts."""

from __future__ import annotations

import os
import sqlite3
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impactd.storage.errors import IdempotencyConflictError, NotFoundError
from impactd.storage.index import Index, as_text, from_text
from impactd.storage.request_key import bare_key
from impactd.storage.timestamp import utc_now

MAX_ATTEMPTS = 2
CALIBRATE = "calibrate"
FIT_SHOT = "fit_shot"
DIAGNOSE = "diagnose"
"""The kind of job whose result is kept as a file."""
COMPARE = "compare_shot"
"""The kind of job that waits for no fit and no diagnosis: somebody stands at the rig."""


@dataclass(frozen=True)
class Job:
    """A piece of work for the worker."""

    id: int
    kind: str
    """``compare_shot``, ``fit_shot``, ``fit_campaign``, ``calibrate`` or ``diagnose``."""
    payload: dict[str, Any]
    """What the task needs, JSON."""
    subject: str
    """What it is about, for people: ``shot 17``."""
    state: str
    """``queued``, ``running``, ``done``, ``failed`` or ``cancelled``."""
    attempts: int
    """How often it was started."""
    result: dict[str, Any] | None
    reason: str | None
    """Why it failed, or why its first attempt did."""
    created_utc: str
    started_utc: str | None
    """When it was last started."""
    finished_utc: str | None
    key: str | None
    """The idempotency key as it is stored: with the namespace of `request_key`."""


class JobTable:
    """The table of jobs.

    ``arrival`` is set whenever this process adds a job; whoever runs them clears it and need not
    poll.
    """

    def __init__(self, index: Index) -> None:
        self._index = index
        self.arrival = threading.Event()

    def enqueue(
        self, kind: str, payload: dict[str, Any], subject: str, *, key: str | None = None
    ) -> Job:
        """Add a job, durably; with a known key, return the job of that key.

        Raises IdempotencyConflictError if the key belongs to another job.
        """
        text = as_text(payload)
        with self._index.transaction():
            row = self._by_key(key, kind, text) if key else None
            if row is not None:
                if (row["kind"], row["payload"]) != (kind, text):
                    raise IdempotencyConflictError(str(key), row["id"])
                return _job_of(row)
            number = self._index.write(
                "INSERT INTO jobs (kind, subject, payload, key, state, attempts, created_utc) "
                "VALUES (?, ?, ?, ?, 'queued', 0, ?)",
                (kind, subject, text, key, utc_now()),
            )
            job = self.get(number)
        self.arrival.set()
        return job

    def _by_key(self, key: str, kind: str, payload: str) -> sqlite3.Row | None:
        row = self._index.row("SELECT * FROM jobs WHERE key=?", (key,))
        bare = bare_key(key, has_kind=True)
        if row is not None or bare is None:
            return row
        # Before keys had namespaces all tokens and kinds shared them: another request is another's.
        return self._index.row(
            "SELECT * FROM jobs WHERE key=? AND kind=? AND payload=?", (bare.key, kind, payload)
        )

    def claim(self, *, prompt: bool = False) -> Job | None:
        """Take the oldest job that waits, ``None`` when none does.

        With ``prompt``, only those of the kind `COMPARE`; without, all others.
        """
        waiting = "SELECT id FROM jobs WHERE state='queued' AND (kind=?) = ? ORDER BY id LIMIT 1"
        which = (COMPARE, int(prompt))
        if self._index.row(waiting, which) is None:  # asked often: without the write lock first
            return None
        with self._index.transaction():
            row = self._index.row(waiting, which)
            if row is None:
                return None
            self._index.write(
                "UPDATE jobs SET state='running', attempts=attempts+1, runner=?, started_utc=? "
                "WHERE id=?",
                (_this_process(), utc_now(), row["id"]),
            )
            return self.get(row["id"])

    def finish(self, number: int, result: dict[str, Any]) -> Job:
        """Write the result of a job."""
        return self._end(number, "done", result=as_text(result), reason=None)

    def fail(self, number: int, reason: str, *, retry: bool = False) -> Job:
        """Write why a job failed; with ``retry`` it waits again, once."""
        with self._index.transaction():
            if retry and self.get(number).attempts < MAX_ATTEMPTS:
                return self._end(number, "queued", result=None, reason=reason)
            return self._end(number, "failed", result=None, reason=reason)

    def cancel_waiting(self, number: int, reason: str) -> bool:
        """Cancel a job unless it was started; return whether that was so."""
        with self._index.transaction():
            if self.get(number).state != "queued":
                return False
            self._end(number, "cancelled", result=None, reason=reason)
            return True

    def cancelled(self, number: int, reason: str) -> Job:
        """Write that a running job was ended because nobody wants its result any more."""
        return self._end(number, "cancelled", result=None, reason=reason)

    def give_back(self, number: int) -> Job:
        """Let a job wait again as if it had not been started: its daemon ended, not its worker."""
        with self._index.transaction():
            self._index.write("UPDATE jobs SET attempts=attempts-1 WHERE id=?", (number,))
            return self._end(number, "queued", result=None, reason=None)

    def requeue_abandoned(self) -> list[Job]:
        """Let jobs wait again whose daemon is gone, as if they had not been started."""
        with self._index.transaction():
            return [
                self.give_back(row["id"])
                for row in self._index.rows("SELECT id, runner FROM jobs WHERE state='running'")
                if row["runner"] is None or not _is_alive(row["runner"])
            ]

    def get(self, number: int) -> Job:
        """Return one job; raise NotFoundError."""
        row = self._index.row("SELECT * FROM jobs WHERE id=?", (number,))
        if row is None:
            raise NotFoundError("job", number)
        return _job_of(row)

    def list(
        self, *, state: str | None = None, kind: str | None = None, limit: int | None = 50
    ) -> list[Job]:
        """Return jobs, newest first; at most ``limit``, or all."""
        rows = self._index.rows(
            "SELECT * FROM jobs WHERE (? IS NULL OR state=?) AND (? IS NULL OR kind=?) "
            "ORDER BY id DESC LIMIT ?",
            (state, state, kind, kind, -1 if limit is None else limit),
        )
        return [_job_of(row) for row in rows]

    def waiting(self) -> int:
        """Return how many jobs wait or run."""
        return self._index.number("SELECT count(*) FROM jobs WHERE state IN ('queued', 'running')")

    def _end(self, number: int, state: str, *, result: str | None, reason: str | None) -> Job:
        with self._index.transaction():
            finished = None if state == "queued" else utc_now()
            changed = self._index.write(
                "UPDATE jobs SET state=?, result=?, reason=?, finished_utc=?, runner=NULL "
                "WHERE id=?",
                (state, result, reason, finished, number),
            )
            if not changed:
                raise NotFoundError("job", number)
            return self.get(number)


def _this_process() -> str:
    return f"{os.getpid()}:{_start_ticks(os.getpid())}"


def _start_ticks(pid: int) -> str:
    # Field 22 of /proc/PID/stat: with it, a number that the kernel gave to another process since
    # is not mistaken for the one that claimed the job. The name before it may hold spaces.
    text = Path(f"/proc/{pid}/stat").read_text()
    return text.rpartition(")")[2].split()[19]


def _is_alive(runner: str) -> bool:
    pid, _, ticks = runner.partition(":")
    try:
        return _start_ticks(int(pid)) == ticks
    except (OSError, ValueError):
        return False


def _job_of(row: sqlite3.Row) -> Job:
    return Job(
        id=row["id"],
        kind=row["kind"],
        payload=from_text(row["payload"]),
        subject=row["subject"],
        state=row["state"],
        attempts=row["attempts"],
        result=None if row["result"] is None else from_text(row["result"]),
        reason=row["reason"],
        created_utc=row["created_utc"],
        started_utc=row["started_utc"],
        finished_utc=row["finished_utc"],
        key=row["key"],
    )
