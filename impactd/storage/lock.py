"""The lock of an archive: shared by all who use it, taken alone by whoever rebuilds its index.

It is held on the folder of the shots. A file of its own could be deleted and made anew, and its two
holders would not meet.
"""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from impactd.storage.errors import ArchiveError

LOCKED_NAME = "shots"
"""Not the archive's folder itself: that is the one of the daemon's lock."""


def lock_archive(directory: Path, *, alone: bool) -> int:
    """Lock an archive's directory, ``alone`` or together with others; return a descriptor.

    Closing it gives the lock back, and so does the end of the process. Raises ArchiveError if
    another process holds a lock that excludes this one.
    """
    try:
        descriptor = os.open(directory / LOCKED_NAME, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    except OSError as error:
        raise ArchiveError(
            f"The archive {directory} cannot be opened: {error.strerror}.",
            remedy="Check storage.directory, its owner and its mode.",
        ) from error
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_EX if alone else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        raise ArchiveError(
            f"The archive {directory} is in use by another process.",
            why="A daemon runs on it, or its index is being rebuilt.",
            remedy="Stop the daemon, or wait, and try again.",
        ) from error
    return descriptor
