"""Which folders keep a file beyond the end of the process that wrote it."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

_IN_MEMORY = frozenset({"tmpfs", "ramfs", "devtmpfs", "hugetlbfs", "rootfs"})
"""File systems that end with the machine, or, like a RuntimeDirectory, with the service."""
_EMPTIED = ("/tmp", "/var/tmp", "/dev/shm", "/run")  # noqa: S108 - named to be refused
"""Folders that systemd empties: with the service (PrivateTmp, RemoveIPC), at a start, or by age."""


@dataclass(frozen=True)
class Mount:
    """A mount point and its file system."""

    point: Path
    kind: str
    """E.g. ``ext4`` or ``tmpfs``."""


def why_not_lasting(folder: Path) -> str | None:
    """Return why files in a folder may be gone after the daemon's end, ``None`` if they stay.

    The reason continues a sentence that names the folder. The folder need not be there yet.
    """
    real = folder.expanduser().resolve()
    for name in dict.fromkeys((*_EMPTIED, os.environ.get("TMPDIR") or _EMPTIED[0])):
        if real.is_relative_to(Path(name).resolve()):
            return f"lies in {name}, which is emptied when a service or the machine stops"
    mount = mount_of(real)
    if mount.kind in _IN_MEMORY:
        return f"lies in memory ({mount.kind} at {mount.point})"
    return None


def mount_of(folder: Path) -> Mount:
    """Return the mount that a folder (absolute, without links) lies in.

    It is the deepest one; of two at one place the later, which hides the other.
    """
    best = Mount(Path("/"), "unknown")
    for line in Path("/proc/self/mountinfo").read_text(encoding="utf-8").splitlines():
        before, _, after = line.partition(" - ")  # see proc(5)
        point = Path(re.sub(r"\\([0-7]{3})", _unescaped, before.split()[4]))
        if folder.is_relative_to(point) and len(point.parts) >= len(best.point.parts):
            best = Mount(point, after.split()[0])
    return best


def _unescaped(found: re.Match[str]) -> str:
    """Return the blank, tab, newline or backslash that mountinfo writes as an octal number."""
    return chr(int(found[1], 8))
