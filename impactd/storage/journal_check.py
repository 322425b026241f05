"""Checks every line of a journal, and that the index says what its journal says."""

from __future__ import annotations

import hashlib
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from impactd.storage import checksums, journal_rows
from impactd.storage.errors import ArchiveError
from impactd.storage.journal import Entry, entries
from impactd.storage.journaling import position

_NAMED = 10
"""Rows that are named one by one; beyond that the index as a whole is not what it should be."""

_Images = dict[tuple[str, tuple[Any, ...]], bytes]


class Lines:
    """Reads a journal in order and remembers what is wrong with it.

    Attributes
    ----------
    n : int
        Of the last line that could be read.
    end_bytes : int
        Where that one ends. [B]
    damaged : list of int
        Lines that are not what was written, counted from 1.
    damaged_end : list of int
        Those of them behind which none could be read.
    missing : list of tuple of int
        First and last number of each row of transactions that are not there.
    torn : bool
        Whether the last line has no end: its writer was killed, and nobody was told of it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.id: str | None = None
        self.n = 0
        self.end_bytes = 0
        self.damaged: list[int] = []
        self.damaged_end: list[int] = []
        self.missing: list[tuple[int, int]] = []
        self.torn = False

    def read(self, *, end_bytes: int | None = None) -> Iterator[tuple[int, list[Any]]]:
        """Yield number and changes of each sound transaction, up to a size. [B]"""
        for entry in entries(self._path, end_bytes=end_bytes):
            body = entry.body
            if body is None or (entry.line == 1) != ("journal" in body):
                self._note(entry)
                continue
            if entry.line == 1:
                self.id = str(body["journal"])
            else:
                if body["n"] > self.n + 1:
                    self.missing.append((self.n + 1, body["n"] - 1))
                yield body["n"], body["rows"]
            self.n, self.end_bytes = body["n"], entry.end_bytes
            self.damaged_end = []

    def _note(self, entry: Entry) -> None:
        if entry.whole:
            self.damaged.append(entry.line)
            self.damaged_end.append(entry.line)
        else:
            self.torn = True

    def whole(self) -> bool:
        """Return whether all that was read is what was written, and nothing is missing."""
        return self.id is not None and not self.damaged and not self.missing


def journal_problems(index_path: Path, journal_path: Path) -> Iterator[str]:
    """Yield what is wrong with a journal, and where the index does not say the same.

    Writers may be at work: what is compared is what was committed when it began.

    Yields
    ------
    str
        One sentence each; none when all is well.
    """
    try:
        with closing(sqlite3.connect(index_path)) as connection:
            connection.execute("BEGIN")
            at = position(connection)
            if at is None:
                yield "the index knows of no journal; run `impactd reindex`."
                return
            lines, images = Lines(journal_path), _Images()
            for _, rows in lines.read(end_bytes=at.size_bytes):
                _fold(images, rows)
            yield from (f"line {line} is not what was written." for line in lines.damaged)
            for first, last in lines.missing:
                yield f"transactions {first} to {last} are missing."
            if (lines.id, lines.n, lines.end_bytes) != (at.journal, at.n, at.size_bytes):
                yield (
                    f"it ends with transaction {lines.n} of {lines.id}, and the index with "
                    f"{at.n} of {at.journal}; run `impactd reindex`."
                )
            yield from _differences(connection, images)
    except (sqlite3.Error, UnicodeDecodeError) as error:
        yield f"it cannot be compared with the index: {error}."
    except ArchiveError as error:
        yield str(error)


def _fold(images: _Images, rows: list[Any]) -> None:
    for table, first, *last in rows:
        if not last:
            key = tuple(first[name] for name in journal_rows.key_of(table))
            images[table, key] = _digest(
                tuple(first.get(name) for name in checksums.COLUMNS[table].split())
            )
        elif len(first) == 1 and isinstance(first[0], int):
            for number in range(first[0], last[0][0] + 1):
                images.pop((table, (number,)), None)
        else:
            images.pop((table, tuple(first)), None)


def _differences(connection: sqlite3.Connection, images: _Images) -> Iterator[str]:
    wrong: list[str] = []
    for table in journal_rows.TABLES:
        names = checksums.COLUMNS[table].split()
        for row in connection.execute(f"SELECT {', '.join(names)} FROM {table}"):  # noqa: S608 - our names
            key = tuple(row[names.index(name)] for name in journal_rows.key_of(table))
            if images.pop((table, key), None) != _digest(tuple(row)):
                wrong.append(f"row {_said(key)} of {table} in the index is not what it says.")
    wrong += [f"row {_said(key)} of {table} is not in the index." for table, key in images]
    yield from wrong[:_NAMED]
    if len(wrong) > _NAMED:
        yield f"{len(wrong) - _NAMED} more rows differ."


def _said(key: tuple[Any, ...]) -> str:
    return " ".join(str(part) for part in key)


def _digest(values: tuple[Any, ...]) -> bytes:
    return hashlib.blake2b(repr(values).encode(), digest_size=8).digest()
