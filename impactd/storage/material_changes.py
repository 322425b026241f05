"""The file of the changes that people made to materials: one line each, whole or absent."""

from __future__ import annotations

import os
from pathlib import Path

from impactd.storage.publish import sync_directory

MATERIAL_CHANGES_NAME = "material-changes.jsonl"


def append_line(file: Path, line: bytes) -> None:
    """Write a line at the end, durably; OSError leaves the file as it was."""
    new = not file.exists()
    descriptor = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o640)
    try:
        size = os.fstat(descriptor).st_size
        try:
            view = memoryview(line)
            while view:
                view = view[os.write(descriptor, view) :]
            os.fsync(descriptor)
        except OSError:
            os.ftruncate(descriptor, size)  # else the next line would go on in this one
            raise
    finally:
        os.close(descriptor)
    if new:
        sync_directory(file.parent)


def whole_lines(file: Path) -> list[str]:
    """Return the lines; an unfinished last line, left by a power cut, is taken off the file."""
    lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        lines.pop()  # nobody was told that it counts
        os.truncate(file, len("".join(lines).encode()))
    return lines
