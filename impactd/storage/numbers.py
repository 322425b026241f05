"""The one sequence that drops and shots draw their numbers from: short, from 1, never repeated."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from pathlib import Path

from impactd.storage.index import Index
from impactd.storage.publish import publish

LAST_NUMBER_NAME = "last-number"


class NumberSequence:
    """The sequence, in the index and in a file of its own.

    The file outlives a lost index: numbers of drops that left no shot are not given out again.
    """

    def __init__(self, index: Index, directory: Path) -> None:
        self._index = index
        self._path = directory / LAST_NUMBER_NAME

    def draw(self) -> int:
        """Return the next number, durably taken; joins the caller's transaction."""
        with self._index.transaction():
            number = 1 + max(self.last(), self.last_in_file())
            publish(self._path, _text(number), replace=True)
            self._index.write("UPDATE sequence SET last=? WHERE name='drop'", (number,))
            return number

    def raise_to(self, number: int) -> None:
        """Continue the sequence after a number, if it is not beyond it already."""
        with self._index.transaction():
            last = max(number, self.last(), self.last_in_file())
            publish(self._path, _text(last), replace=True)
            self._index.write("UPDATE sequence SET last=? WHERE name='drop'", (last,))

    def last(self) -> int:
        """Return the last number the index gave out, 0 before the first."""
        return self._index.number("SELECT last FROM sequence WHERE name='drop'")

    def last_in_file(self) -> int:
        """Return the last number the file remembers, 0 where it is absent or unreadable."""
        try:
            return self._read()
        except (OSError, ValueError):
            return 0

    def findings(self) -> Iterator[tuple[str, str | None]]:
        """Yield the name of the file, if there is one, and what is wrong with it.

        Yields
        ------
        tuple of str and (str or None)
            Name, and a sentence; ``None`` where it is sound.
        """
        if not self._path.exists():
            return
        try:
            number = self._read()
        except (OSError, ValueError) as error:
            yield str(self._path), f"it is not what was written ({error})."
            return
        # A number that was drawn and given back stays used: the file may be ahead.
        behind = number < self.last()
        yield str(self._path), "it is behind the index." if behind else None

    def _read(self) -> int:
        """Return the number; raise ValueError when its check does not fit (older files: none)."""
        content = self._path.read_bytes()
        number = int(content.split()[0])
        if content not in (_text(number), f"{number}\n".encode()):
            raise ValueError("the check does not fit the number")
        return number


def _text(number: int) -> bytes:
    return f"{number} check {zlib.crc32(str(number).encode()):08x}\n".encode()
