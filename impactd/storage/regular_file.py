"""Opening files that somebody else may have made: regular ones only, none larger than expected.

A FIFO blocks who opens it, a device never ends, a link leads anywhere, and a file full of holes
claims more bytes than there is memory. None of them is opened for reading here.
"""

from __future__ import annotations

import errno
import os
import stat
from contextlib import ExitStack
from pathlib import Path
from typing import BinaryIO

_KINDS = {
    stat.S_IFIFO: "a FIFO",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
    stat.S_IFDIR: "a directory",
}


class IrregularFileError(OSError):
    """A file must not be read; ``strerror`` continues a sentence that names it."""

    def __init__(self, reason: str) -> None:
        super().__init__(errno.EINVAL, reason)


def open_regular_file(path: Path, limit_bytes: int) -> BinaryIO:
    """Return a regular file of at most ``limit_bytes``, open for reading; the caller closes it.

    Folders on the way may be links, the file itself may not.

    Raises
    ------
    IrregularFileError
        If it is a link, no regular file, or larger.
    OSError
        If it cannot be opened.
    """
    # O_NONBLOCK: a FIFO that nobody writes to would be waited for, before it could be looked at.
    flags = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC
    try:
        descriptor = os.open(path, flags)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise IrregularFileError("is a link, and links are not followed") from error
        if error.errno == errno.ENXIO:  # what open() says to a socket
            raise IrregularFileError("is a socket or a device, no regular file") from error
        raise
    with ExitStack() as stack:
        stack.callback(os.close, descriptor)
        found = os.fstat(descriptor)
        if not stat.S_ISREG(found.st_mode):
            kind = _KINDS.get(stat.S_IFMT(found.st_mode), "something else")
            raise IrregularFileError(f"is {kind}, no regular file")
        if found.st_size > limit_bytes:
            raise IrregularFileError(f"has {found.st_size} bytes; at most {limit_bytes} are read")
        stack.pop_all()
    return os.fdopen(descriptor, "rb")


def read_regular_file(path: Path, limit_bytes: int) -> bytes:
    """Return the bytes that a regular file had when it was opened; see `open_regular_file`.

    Raises
    ------
    IrregularFileError
        If it is a link, no regular file, larger, or does not fit into memory.
    OSError
        If it cannot be read.
    """
    with open_regular_file(path, limit_bytes) as file:
        size_bytes = os.fstat(file.fileno()).st_size
        try:
            return file.read(size_bytes)
        except MemoryError as error:
            raise IrregularFileError(
                f"has {size_bytes} bytes, more than the free memory"
            ) from error
