"""The journal: an append-only file of what was committed, synced before the index says so.

::

    {"crc32":"9b1c0f3a","n":0,"format":"impactd-journal/1","journal":"5f0c...","utc":"..."}
    {"crc32":"04ad77c1","n":1,"utc":"...","rows":[["drops",{"number":1,"state":"requested",...}]]}
    {"crc32":"d8e20b55","n":2,"utc":"...","rows":[["events",[1],[1000]]]}

One line is one transaction. A row is ``[table, its columns after the change]``, or
``[table, first key, last key]`` where rows were deleted. The checksum is that of the line's other
bytes: of the same object without its first member.
"""

from __future__ import annotations

import errno
import json
import os
import secrets
import shutil
import zlib
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impactd.storage.errors import ArchiveError, StorageFullError
from impactd.storage.publish import FULL
from impactd.storage.timestamp import utc_now

JOURNAL_NAME = "journal.jsonl"
FORMAT = "impactd-journal/1"

_PREFIX, _AFTER = b'{"crc32":"', b'",'
_BODY_AT = len(_PREFIX) + 8 + len(_AFTER)

Change = list[Any]


@dataclass(frozen=True)
class Position:
    """A place in a journal."""

    journal: str
    n: int
    """Number of the last transaction, 0 before the first."""
    size_bytes: int
    """Where the line of that transaction ends. [B]"""


@dataclass(frozen=True)
class Entry:
    """A line of a journal as it was read."""

    line: int
    """From 1, for people."""
    end_bytes: int
    """Where it ends. [B]"""
    body: dict[str, Any] | None
    """``None`` where it is not what was written."""
    whole: bool
    """Whether it has its end; the last line of a writer that was killed may lack it."""


def line_of(body: dict[str, Any]) -> bytes:
    """Return the line of a body, with its checksum."""
    text = json.dumps(body, ensure_ascii=False, separators=(",", ":")).encode()
    return b"%s%08x%s%s\n" % (_PREFIX, zlib.crc32(text), _AFTER, text[1:])


def _body_of(line: bytes) -> dict[str, Any] | None:
    text = b"{" + line[_BODY_AT:-1]
    expected = b"%s%08x%s" % (_PREFIX, zlib.crc32(text), _AFTER)
    if line[:_BODY_AT] != expected or line[-1:] != b"\n":
        return None
    body: dict[str, Any] = json.loads(text)
    return body


def entries(path: Path, *, start_bytes: int = 0, end_bytes: int | None = None) -> Iterator[Entry]:
    """Yield the lines of a journal, whole or not.

    Parameters
    ----------
    start_bytes : int
        Where a line begins. [B]
    end_bytes : int, optional
        Where to stop: what lies behind may be under way. [B]

    Yields
    ------
    Entry
        In their order.

    Raises
    ------
    ArchiveError
        If the file cannot be read.
    """
    try:
        with path.open("rb") as file:
            file.seek(start_bytes)
            at = start_bytes
            for number, line in enumerate(file, start=1):
                at += len(line)
                if end_bytes is not None and at > end_bytes:
                    return
                yield Entry(number, at, _body_of(line), line.endswith(b"\n"))
    except OSError as error:
        raise ArchiveError(
            f"The journal {path} cannot be read: {error.strerror}.",
            remedy="Check its owner and the disk; `impactd reindex` writes it again.",
        ) from error


def write_whole(path: Path, changes: Iterable[list[Change]]) -> Position:
    """Write a new journal, durably, and return its end; an older one is replaced.

    Raises
    ------
    StorageFullError
        If the disk is full.
    ArchiveError
        If it cannot be written.
    """
    journal = secrets.token_hex(8)
    n, size = 0, 0
    descriptor = -1
    try:
        path.unlink(missing_ok=True)
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o640)
        with os.fdopen(descriptor, "wb") as file:
            header = {"n": 0, "format": FORMAT, "journal": journal, "utc": utc_now()}
            size += file.write(line_of(header))
            for n, rows in enumerate(changes, start=1):
                size += file.write(line_of({"n": n, "utc": utc_now(), "rows": rows}))
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        with suppress(OSError):
            path.unlink(missing_ok=True)
        raise _translated(error, path) from error
    return Position(journal, n, size)


def id_of(path: Path) -> str | None:
    """Return the id of a journal, ``None`` where its first line cannot be read."""
    first = next(entries(path), None)
    if first is None or first.body is None or first.body.get("format") != FORMAT:
        return None
    return str(first.body["journal"])


class Journal:
    """A journal that is written to; its writers take turns by the write lock of the index.

    The file exists; ArchiveError is raised if it cannot be opened.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CLOEXEC)
        except OSError as error:
            raise _translated(error, path) from error

    def append(self, at: Position, rows: list[Change]) -> Position:
        """Append a transaction durably after the last committed one, which ended at ``at``.

        What lies behind that was never acknowledged, and is overwritten.

        Raises
        ------
        StorageFullError
            If the disk is full.
        ArchiveError
            If it cannot be written.
        """
        line = line_of({"n": at.n + 1, "utc": utc_now(), "rows": rows})
        try:
            self._check_name()
            try:
                self._write(at.size_bytes, line)
            except OSError as error:
                if error.errno != errno.EIO:
                    raise
                # After a failed sync the kernel takes the pages for clean: only what is written
                # anew is brought to the disk by the next one.
                self._write(at.size_bytes, line)
        except OSError as error:
            self.cut(at.size_bytes)
            raise _translated(error, self.path) from error
        return Position(at.journal, at.n + 1, at.size_bytes + len(line))

    def cut(self, size_bytes: int) -> None:
        """Remove the bytes after a size, as far as the disk permits; `append` does so too."""
        with suppress(OSError):
            if os.fstat(self._file).st_size > size_bytes:
                os.ftruncate(self._file, size_bytes)
                os.fdatasync(self._file)

    def size_bytes(self) -> int:
        """Return how long the file is. [B]"""
        return os.fstat(self._file).st_size

    def close(self) -> None:
        """Close the file; safe to call twice."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _check_name(self) -> None:
        # A deleted file can be written to, and nothing of it is found again.
        if not os.path.samestat(os.fstat(self._file), self.path.stat()):
            raise FileNotFoundError(errno.ENOENT, "another file has taken its name")

    def _write(self, at: int, line: bytes) -> None:
        size = os.fstat(self._file).st_size
        if size < at:
            raise OSError(errno.EIO, f"it has {size} bytes of {at}")
        if size > at:
            os.ftruncate(self._file, at)
        view = memoryview(line)
        while view:
            written = os.pwrite(self._file, view, at)
            view, at = view[written:], at + written
        os.fdatasync(self._file)


def _translated(error: OSError, path: Path) -> ArchiveError:
    if error.errno in FULL:
        free = shutil.disk_usage(path.parent).free
        return StorageFullError(str(path.parent), free_bytes=free, needed_bytes=0)
    return ArchiveError(
        f"The journal {path} cannot be written: {error.strerror}.",
        why="This transaction was not acknowledged.",
        remedy=(
            "Check the disk (`dmesg`), and the owner and mode of the archive's directory. If the "
            "file is gone, stop the daemon and run `impactd reindex`."
        ),
    )
