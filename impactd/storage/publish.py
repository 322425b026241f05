"""Write a file so that it is there whole or not at all, also after a power cut.

Open exclusively, reserve the space, write, fsync, rename, fsync the directory: a full disk is an
ordinary error before anything became visible, and a name never points at half a file.
"""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from impactd.storage.errors import ArchiveError, StorageFullError

_FULL = (errno.ENOSPC, errno.EDQUOT)


def publish(path: Path, content: bytes, *, replace: bool = False) -> None:
    """Write a file durably; return when it would survive a power cut.

    Parameters
    ----------
    path : Path
        Its final name; the directory exists.
    content : bytes
        The whole file.
    replace : bool
        Whether an older file of that name may go.

    Raises
    ------
    StorageFullError
        If the file system has no room; nothing is left behind.
    ArchiveError
        If the name is taken or the directory cannot be written.
    """
    if not replace and path.exists():
        raise ArchiveError(f"{path} exists already, and stored files are never changed.")
    draft = path.with_name(f".{path.name}.{os.getpid()}.draft")
    try:
        _write_durably(draft, content)
        if replace:
            draft.rename(path)
        else:
            # link() refuses an existing name, rename() would replace it silently.
            os.link(draft, path)
            draft.unlink()
        _sync_directory(path.parent)
    except OSError as error:
        draft.unlink(missing_ok=True)
        if error.errno in _FULL:
            free = shutil.disk_usage(path.parent).free
            raise StorageFullError(
                str(path.parent), free_bytes=free, needed_bytes=len(content)
            ) from error
        raise ArchiveError(
            f"{path} cannot be written: {error.strerror}.",
            remedy="Check the owner and mode of the archive's directory.",
        ) from error


def _write_durably(path: Path, content: bytes) -> None:
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
    try:
        if content:
            os.posix_fallocate(descriptor, 0, len(content))
        view = memoryview(content)
        while view:
            view = view[os.write(descriptor, view) :]
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_directory(directory: Path) -> None:
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
