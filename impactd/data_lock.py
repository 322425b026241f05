"""One daemon per data directory, held by a lock that a dead daemon cannot keep."""

from __future__ import annotations

import fcntl
import json
import os
from pathlib import Path
from types import TracebackType
from typing import Any

LOCK_NAME = "daemon.lock"


class DataLockedError(Exception):
    """Another daemon serves this data directory.

    Parameters
    ----------
    directory : Path
        The data directory.
    holder : dict
        What the other daemon wrote about itself: ``pid``, ``url``.
    """

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
    """Exclusive use of a data directory.

    Parameters
    ----------
    directory : Path
        Created when absent.

    Raises
    ------
    DataLockedError
        If another process holds it.

    Notes
    -----
    ``flock`` belongs to the open file: the kernel drops it with the process, however it ends.
    """

    def __init__(self, directory: Path) -> None:
        directory.mkdir(mode=0o750, parents=True, exist_ok=True)
        self._path = directory / LOCK_NAME
        self._file = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._file)
            raise DataLockedError(directory, read_holder(directory)) from None
        self.tell(url=None)

    def tell(self, *, url: str | None) -> None:
        """Write who holds the directory, for the sentence another process prints."""
        os.ftruncate(self._file, 0)
        os.pwrite(self._file, json.dumps({"pid": os.getpid(), "url": url}).encode(), 0)

    def release(self) -> None:
        """Let the next one in; safe to call twice."""
        if self._file >= 0:
            os.ftruncate(self._file, 0)
            os.close(self._file)
            self._file = -1

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
    """Return what the daemon of a data directory wrote about itself.

    Parameters
    ----------
    directory : Path
        The data directory.

    Returns
    -------
    dict
        ``pid`` and ``url``, empty when no daemon wrote anything.
    """
    try:
        text = (directory / LOCK_NAME).read_text()
        holder = json.loads(text) if text else {}
    except (OSError, ValueError):
        return {}
    return holder if isinstance(holder, dict) else {}
