"""One daemon per data directory, held by a lock that a dead daemon cannot keep."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

LOCK_NAME = "daemon.lock"
"""The note that says who holds the directory; the lock does not depend on it."""


class DataLockedError(Exception):
    """Another daemon serves this data directory; ``holder`` is its ``pid`` and ``url``."""

    def __init__(self, directory: Path, holder: dict[str, Any]) -> None:
        self.directory = directory
        self.holder = holder
        who = f"process {holder['pid']}" if "pid" in holder else "another process"
        at = f" at {holder['url']}" if holder.get("url") else ""
        super().__init__(
            f"The data directory {directory} is in use by {who}{at}: stop that daemon first, or "
            "give another --data."
        )


class DataLock:
    """Exclusive use of a data directory, which is created when absent.

    Raises DataLockedError if another process holds it.

    ``flock`` belongs to the open file: the kernel drops it with the process, however it ends. It is
    held on the directory itself: a file in it could be deleted and made anew, and two daemons would
    each hold a lock of their own. A network file system may refuse locks on directories; SQLite's
    write-ahead log does not work there either.
    """

    def __init__(self, directory: Path) -> None:
        directory.mkdir(mode=0o750, parents=True, exist_ok=True)
        self._path = directory / LOCK_NAME
        self._directory = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            fcntl.flock(self._directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.tell(url=None)
        except BlockingIOError:
            os.close(self._directory)
            raise DataLockedError(directory, read_holder(directory)) from None
        except BaseException:
            os.close(self._directory)
            raise

    def tell(self, *, url: str | None) -> None:
        """Write who holds the directory, for the sentence another process prints."""
        self._note(json.dumps({"pid": os.getpid(), "url": url}))

    def _note(self, text: str) -> None:
        file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o640)
        try:
            os.write(file, text.encode())
        finally:
            os.close(file)

    def release(self) -> None:
        """Release the lock; safe to call twice."""
        if self._directory >= 0:
            try:
                self._note("")
            finally:
                os.close(self._directory)
                self._directory = -1

    def __enter__(self) -> DataLock:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()


def read_holder(directory: Path) -> dict[str, Any]:
    """Return ``pid`` and ``url`` of a data directory's daemon, nothing when it wrote none."""
    try:
        text = (directory / LOCK_NAME).read_text()
        holder = json.loads(text) if text else {}
    except (OSError, ValueError):
        return {}
    return holder if isinstance(holder, dict) else {}
