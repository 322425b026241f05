"""A record that its own disk does not take when the daemon must go: kept on another one.

Nobody can ask for the same fall again. The whole shot file is written wherever there is room, and
the next start takes it into the archive. Only folders that belong to this user count: what lies in
a folder of all users may be anybody's.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

from impactd.storage.errors import ArchiveError
from impactd.storage.publish import publish

_FOLDER = "impactd-rescued"


def places() -> list[Path]:
    """Return where a record may be kept, best first.

    Returns
    -------
    list of Path
        The cache of the service or of the user, then folders for temporary files; the last one is
        memory, which outlives the daemon but not the machine.
    """
    cache = os.environ.get("CACHE_DIRECTORY", "").partition(":")[0]
    home = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    for_all = ("/var/tmp", tempfile.gettempdir(), "/dev/shm")  # noqa: S108 - in a folder of our own
    found = [Path(name).expanduser() for name in (cache, home, *for_all) if name]
    return list(dict.fromkeys(found))


def keep(archive: Path, number: int, content: bytes) -> Path:
    """Write a shot file outside the archive, durably.

    Parameters
    ----------
    archive : Path
        Folder of the archive that has no room for it.
    number : int
        Of the drop.
    content : bytes
        The whole file.

    Returns
    -------
    Path
        Where it is now.

    Raises
    ------
    ArchiveError
        If no place took it.
    """
    refusals = []
    for place in places():
        path = _path(place, archive, number)
        try:
            path.parent.parent.mkdir(mode=0o700, exist_ok=True)
            path.parent.mkdir(mode=0o700, exist_ok=True)
            if not _ours(path):
                raise PermissionError(0, "the folder belongs to somebody else")
            publish(path, content, replace=True)
        except (OSError, ArchiveError) as error:
            refusals.append(f"{place} ({getattr(error, 'strerror', None) or error})")
        else:
            return path
    raise ArchiveError(f"No other disk takes the record either: {'; '.join(refusals)}.")


def find(archive: Path, number: int) -> Path | None:
    """Return the file that `keep` wrote for a drop of an archive.

    Parameters
    ----------
    archive : Path
        Folder of the archive.
    number : int
        Of the drop.

    Returns
    -------
    Path or None
        ``None`` where there is none, or it is not ours.
    """
    paths = (_path(place, archive, number) for place in places())
    return next((path for path in paths if path.is_file() and _ours(path)), None)


def _path(place: Path, archive: Path, number: int) -> Path:
    which = hashlib.sha256(str(archive.resolve()).encode()).hexdigest()[:16]
    return place / _FOLDER / which / f"{number:06d}.h5"


def _ours(path: Path) -> bool:
    """Tell whether nobody else can have put a file there."""
    folders = (path.parent.parent, path.parent)
    return all(
        not folder.is_symlink()
        and folder.stat().st_uid == os.getuid()
        and not folder.stat().st_mode & 0o022
        for folder in folders
    )
