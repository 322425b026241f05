"""A record that its own disk does not take when the daemon must go: kept on another one.

Nobody can ask for the same fall again. The whole shot file is written to the first place that takes
it, and the next start takes it into the archive. A place must keep files beyond the daemon's end,
which folders for temporary files do not. Only folders that belong to this user count: what lies in
a folder of all users may be anybody's.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from pathlib import Path

from impactd.storage.errors import ArchiveError
from impactd.storage.lasting import why_not_lasting
from impactd.storage.publish import publish
from impactd.storage.regular_file import read_regular_file
from impactd.storage.timestamp import utc_now

_FOLDER = "impactd-rescued"
_MARK_LIMIT_BYTES = 4096


@dataclass(frozen=True)
class Mark:
    """The mark that a daemon left at its start."""

    start: str
    """Identity of that start."""
    utc: str


def places(configured: Path | None) -> list[Path]:
    """Return where a record may be kept, best first.

    First the ``storage.rescue_directory`` of the settings, then the cache of the service, or where
    there is none that of the user; those that do not keep files are left out.
    """
    cache = os.environ.get("CACHE_DIRECTORY", "").partition(":")[0]
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    wanted = [configured, Path(cache or home)]
    found = [path.expanduser().absolute() for path in wanted if path is not None]
    return [path for path in dict.fromkeys(found) if why_not_lasting(path) is None]


def keep(archive: Path, number: int, content: bytes, configured: Path | None) -> Path:
    """Write a shot file outside an archive that has no room for it, durably.

    Raises ArchiveError if no place took it.
    """
    refusals = []
    if configured is not None and (why := why_not_lasting(configured)):
        refusals.append(f"{configured} ({why})")
    for place in places(configured):
        path = place / _FOLDER / _hash(archive) / f"{number:06d}.h5"
        try:
            if place != configured:
                place.mkdir(mode=0o700, parents=True, exist_ok=True)
            _make_folders(path.parent)
            publish(path, content, replace=True)
        except (OSError, ArchiveError) as error:
            refusals.append(f"{place} ({getattr(error, 'strerror', None) or error})")
        else:
            return path
    tried = "; ".join(refusals) or "storage.rescue_directory names none"
    raise ArchiveError(f"No other disk takes the record either: {tried}.")


def find(archive: Path, number: int, configured: Path | None) -> Path | None:
    """Return the file that `keep` wrote for a drop of an archive.

    ``None`` where there is none, or where somebody else can have written it.
    """
    name = f"{number:06d}.h5"
    paths = [place / _FOLDER / _hash(archive) / name for place in places(configured)]
    return next((path for path in paths if path.is_file() and _ours(path.parent)), None)


def leave_mark(place: Path, archive: Path, start: str) -> None:
    """Leave a file in a place that shows at the next start whether the place keeps files.

    ``start`` is the identity of this start. Raises OSError or ArchiveError if the place does not
    take it, or does not keep files.
    """
    why = why_not_lasting(place)
    if why is not None:
        raise ArchiveError(f"The rescue directory {place} {why}.")
    marks = [Mark(start, utc_now()), *read_marks(place, archive)][:2]
    content = json.dumps([{"start": one.start, "utc": one.utc} for one in marks]) + "\n"
    _make_folders(place.expanduser() / _FOLDER)
    publish(_mark_path(place, archive), content.encode(), replace=True)


def read_marks(place: Path, archive: Path) -> list[Mark]:
    """Return the marks of the last two starts in one of `places`, newest first."""
    try:
        kept = json.loads(read_regular_file(_mark_path(place, archive), _MARK_LIMIT_BYTES))
        return [Mark(str(one["start"]), str(one["utc"])) for one in kept]
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []


def try_place(place: Path, size_bytes: int) -> None:
    """Write, sync and remove a file of a record's size where a record would go.

    Raises OSError or ArchiveError if the place would not take the record either.
    """
    _make_folders(place / _FOLDER)
    path = place / _FOLDER / f"trial-{os.getpid()}"
    try:
        publish(path, os.urandom(size_bytes), replace=True)  # not zeros: disks compress
    finally:
        path.unlink(missing_ok=True)


def _mark_path(place: Path, archive: Path) -> Path:
    return place.expanduser() / _FOLDER / f"alive-{_hash(archive)}.json"


def _hash(archive: Path) -> str:
    return hashlib.sha256(str(archive.resolve()).encode()).hexdigest()[:16]


def _make_folders(folder: Path) -> None:
    """Make a folder of ours in a place; an absent place may be a disk that is not mounted."""
    for path in reversed([folder, *folder.parents]):
        if _FOLDER in (path.name, path.parent.name):
            path.mkdir(mode=0o700, exist_ok=True)
    if not _ours(folder):
        raise PermissionError(0, "the folder belongs to somebody else")


def _ours(folder: Path) -> bool:
    """Return whether nobody else can have put a file there."""
    folders = [folder] if folder.name == _FOLDER else [folder.parent, folder]
    return all(
        not one.is_symlink() and one.stat().st_uid == os.getuid() and not one.stat().st_mode & 0o022
        for one in folders
    )
