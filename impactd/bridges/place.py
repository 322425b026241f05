"""The last event that a bridge has sent, kept on the disk."""

from __future__ import annotations

import contextlib
import json
import os
import tempfile
from pathlib import Path

from impactd.client.errors import RigError


class Place:
    """The number of the last event that arrived at the other end.

    Parameters
    ----------
    file : Path or None
        Where it is kept; ``None`` keeps it for this run only.

    Raises
    ------
    RigError
        If the file holds something else.
    """

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self.last: int | None = None
        if file is not None and file.exists():
            try:
                self.last = int(json.loads(file.read_text(encoding="utf-8"))["last_event"])
            except (ValueError, KeyError, TypeError) as error:
                raise RigError(
                    f"{file} holds no event number; remove the file to begin with the next event."
                ) from error

    def arrived(self, number: int) -> None:
        """Keep a number; a crash leaves the old one or the new one."""
        self.last = number
        if self._file is None:
            return
        handle, name = tempfile.mkstemp(dir=self._file.parent, prefix=f".{self._file.name}-")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as new:
                json.dump({"last_event": number}, new)
                new.flush()
                os.fsync(new.fileno())
            Path(name).replace(self._file)
        except BaseException:
            with contextlib.suppress(OSError):
                Path(name).unlink()
            raise
