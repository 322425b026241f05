"""Write a file so that it is there whole or not at all, also after a power cut.

Open exclusively, reserve the space, write, fsync, rename, fsync the directory: a full disk is an
ordinary error before anything became visible, and a name never points at half a file.

When the disk says EIO, everything is written once more, to another file: after a failed fsync the
kernel takes the pages for clean, and a second fsync of the same file would succeed without them.
"""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path

from impactd.storage.errors import ArchiveError, StorageFullError

FULL = (errno.ENOSPC, errno.EDQUOT)
"""Errors of the system that mean "no room"."""


def publish(path: Path, content: bytes, *, replace: bool = False) -> None:
    """Write a file durably; return when it would survive a power cut.

    Parameters
    ----------
    path : Path
        Its final name; the directory exists.
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
        try:
            _publish_once(path, draft, content, replace=replace)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            _publish_once(path, draft, content, replace=replace)
    except OSError as error:
        if error.errno in FULL:
            free = shutil.disk_usage(path.parent).free
            raise StorageFullError(
                str(path.parent), free_bytes=free, needed_bytes=len(content)
            ) from error
        raise ArchiveError(
            f"{path} cannot be written: {error.strerror}.",
            why=_WHY.get(error.errno or 0, ""),
            remedy="Check the disk (`dmesg`), and the owner and mode of the archive's directory.",
        ) from error


_WHY = {errno.EIO: "The disk failed twice; the file was not acknowledged as stored."}


def _publish_once(path: Path, draft: Path, content: bytes, *, replace: bool) -> None:
    try:
        _write_durably(draft, content)
        if replace:
            draft.rename(path)
            sync_directory(path.parent)
            return
        # link() refuses an existing name, rename() would replace it silently.
        os.link(draft, path)
        draft.unlink()
        try:
            sync_directory(path.parent)
        except OSError:
            # What is not known to survive must not be found later under the name of a stored file.
            path.unlink(missing_ok=True)
            raise
    except OSError:
        draft.unlink(missing_ok=True)
        raise


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


def sync_directory(directory: Path) -> None:
    """Let the names in a directory survive a power cut; raise OSError."""
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
