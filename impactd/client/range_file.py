"""A file on the daemon, read in parts as they are needed."""

from __future__ import annotations

import io
import re
from typing import Protocol

import httpx2

from impactd.client.errors import RigError

BLOCK_BYTES = 64 * 1024
"""Of the structure of a shot's file a few blocks are read; a record has some twenty."""


class _Parts(Protocol):
    def part(self, path: str, first: int, last: int, tag: str | None) -> httpx2.Response: ...


class RangeFile(io.RawIOBase):
    """A file of the daemon that fetches what is read of it, each block once.

    Parameters
    ----------
    connection : Connection
        To the daemon.
    path : str
        Of the resource.

    Attributes
    ----------
    fetched_bytes : int
        What came over the line so far.
    """

    def __init__(self, connection: _Parts, path: str) -> None:
        super().__init__()
        self._connection = connection
        self._path = path
        self._at = 0
        self._blocks: dict[int, bytes] = {}
        self._tag: str | None = None
        self.fetched_bytes = 0
        self.size_bytes = self._fetch(0, 0)

    def readable(self) -> bool:
        """Return that it can be read."""
        return True

    def seekable(self) -> bool:
        """Return that any place of it can be read."""
        return True

    def tell(self) -> int:
        """Return where the next read begins."""
        return self._at

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place and return it."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._at, io.SEEK_END: self.size_bytes}[whence]
        self._at = base + offset
        return self._at

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Fill a buffer from here on and return how much of it was filled."""
        end = min(self._at + len(buffer), self.size_bytes)
        if end <= self._at:
            return 0
        first, last = self._at // BLOCK_BYTES, (end - 1) // BLOCK_BYTES
        missing = [block for block in range(first, last + 1) if block not in self._blocks]
        if missing:
            self._fetch(missing[0], missing[-1])
        held = b"".join(self._blocks[block] for block in range(first, last + 1))
        begin = self._at - first * BLOCK_BYTES
        count = end - self._at
        buffer[:count] = held[begin : begin + count]
        self._at = end
        return count

    def _fetch(self, first: int, last: int) -> int:
        begin = first * BLOCK_BYTES
        answer = self._connection.part(self._path, begin, (last + 1) * BLOCK_BYTES - 1, self._tag)
        place = re.fullmatch(r"bytes (\d+)-\d+/(\d+)", answer.headers.get("Content-Range", ""))
        if answer.status_code != httpx2.codes.PARTIAL_CONTENT or place is None:
            raise RigError(f"{self._path} changed while it was read; open it again.")
        self._tag = answer.headers.get("ETag")
        content = answer.content
        self.fetched_bytes += len(content)
        for offset in range(0, len(content), BLOCK_BYTES):
            self._blocks[first + offset // BLOCK_BYTES] = content[offset : offset + BLOCK_BYTES]
        return int(place[2])
