"""The writes of jobs into the archive, in order, each tried again until it succeeds.

A locked index or a full disk passes; no result may be lost over it, and the threads that feed the
workers must not wait for it.
"""

from __future__ import annotations

import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Sequence

import structlog

from impactd.storage.errors import ArchiveError, StorageFullError

_log = structlog.get_logger("impactd.jobs")
RETRY_S = 1.0
"""Between two tries; a try at a locked index itself waits for the busy timeout."""

Write = Callable[[], Sequence["Write"]]
"""Writes one thing and returns what is to be written next, before all that waits."""


def will_pass(error: BaseException) -> bool:
    """Return whether the same write may succeed later.

    It may after a full disk, or an index that is locked or does not answer.
    """
    return isinstance(error, StorageFullError) or (
        isinstance(error, ArchiveError) and isinstance(error.__cause__, sqlite3.OperationalError)
    )


class WriteQueue:
    """A thread that writes, and the writes that wait. Thread safe.

    What is left when it stops is tried again when it is started again.
    """

    def __init__(self) -> None:
        self._waiting: deque[Write] = deque()
        self._news = threading.Event()
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._failed = False

    @property
    def stuck(self) -> bool:
        """Return whether the last try failed: then no job should begin that adds to it."""
        return self._failed

    def start(self) -> None:
        """Start the thread."""
        self._stop.clear()
        self._news.set()
        self._thread = threading.Thread(target=self._run, name="job-writes", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Try once more to write what waits, then end the thread."""
        self._stop.set()
        self._news.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def alive(self) -> bool:
        """Return whether the thread is there."""
        return self._thread is not None and self._thread.is_alive()

    def put(self, write: Write) -> None:
        """Add one thing to write; returns at once."""
        self._waiting.append(write)
        self._news.set()

    def _run(self) -> None:
        while True:
            self._news.wait()
            self._news.clear()
            while self._waiting and self._write_first():
                pass
            if self._stop.is_set():
                if self._waiting:
                    _log.error("ends of jobs are unwritten at the stop", count=len(self._waiting))
                return
            if self._waiting:
                self._stop.wait(RETRY_S)
                self._news.set()

    def _write_first(self) -> bool:
        """Return whether the first of the queue is done with."""
        write = self._waiting[0]
        following: Sequence[Write] = ()
        try:
            following = write()
        except Exception as error:  # the thread must live on
            if will_pass(error):
                if not self._failed:
                    _log.warning("the end of a job waits for the archive", why=str(error))
                self._failed = True
                return False
            _log.exception("the end of a job could not be written")
        self._failed = False
        self._waiting.popleft()  # only this thread takes from the left
        self._waiting.extendleft(reversed(following))
        return True
