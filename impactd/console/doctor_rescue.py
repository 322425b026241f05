"""Whether a record that the archive's disk does not take would be there after the daemon's end."""

# ruff: noqa: PLC0415 - imported when the check runs: `--help` must not wait for numpy

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from impactd.console.doctor_checks import Finding

if TYPE_CHECKING:
    from impactd.settings.settings import Settings

_NAME = "rescue directory"
_BYTES_PER_SAMPLE = 10
"""A code (2 bytes), and its time (8) should it not compress at all."""
_BESIDE_SAMPLES_BYTES = 1_000_000
_PROPOSED = "/srv/impactd-rescue"


def rescue_directory(settings: Settings) -> Iterator[Finding]:
    """Try the place for a record that must leave a full disk: really write and sync one.

    Yields
    ------
    Finding
        Of the place, and of the mark that the daemon left there.
    """
    from impactd.storage import rescue

    archive = settings.storage.directory
    configured = settings.storage.rescue_directory
    if configured is None:
        yield Finding(_NAME, True, *_without(rescue.places(None), archive))
        return
    place = configured.expanduser().absolute()
    tried = _tried(settings, place)
    yield tried
    if tried.well:
        yield _survived(place, archive)


def _without(left: list[Path], archive: Path) -> tuple[str, str]:
    mend = (
        f"Set storage.rescue_directory to a folder on another disk, e.g. {_PROPOSED}, that "
        "belongs to the daemon's user."
    )
    goes = f"goes to {left[0]}, and is lost if that is full, too" if left else "is lost"
    if left and _disk(left[0]) == _disk(archive):
        goes = f"has only {left[0]} to go to, on the same disk, and is lost"
    return (
        f"none is configured: when the disk of {archive} is full and the daemon must end, the "
        f"record in memory {goes}",
        mend,
    )


def _tried(settings: Settings, place: Path) -> Finding:
    from impactd.storage import rescue
    from impactd.storage.errors import ArchiveError
    from impactd.storage.lasting import mount_of, why_not_lasting

    user = os.getuid()
    if not place.is_dir():
        mend = f"sudo install -d -m 0700 -o impactd -g impactd {place}, or mount its disk."
        return Finding(_NAME, False, f"{place} is not there, or no folder", mend)
    why = why_not_lasting(place)
    if why is not None:
        mend = f"Name a folder that stays, e.g. {_PROPOSED}, in storage.rescue_directory."
        return Finding(_NAME, False, f"{place} {why}", mend)
    samples = settings.trigger.record_s * settings.digitizer.sample_rate_hz
    size_bytes = int(_BYTES_PER_SAMPLE * samples) + _BESIDE_SAMPLES_BYTES
    try:
        rescue.try_place(place, size_bytes)
    except (OSError, ArchiveError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        said = f"{place} does not take {size_bytes / 1e6:.1f} MB from user {user}: {reason}"
        mend = (
            "Run this as the daemon's user (runuser -u impactd). Otherwise make that user the "
            "owner, or free space."
        )
        return Finding(_NAME, False, said, mend)
    mount = mount_of(place.resolve())
    said = f"{place} took and synced {size_bytes / 1e6:.1f} MB ({mount.kind} at {mount.point})"
    if _disk(place) == _disk(settings.storage.directory):
        said += "; but it is the archive's own disk, which is full when it is needed"
        return Finding(_NAME, True, said, "Name a folder on another disk.")
    return Finding(_NAME, True, said)


def _survived(place: Path, archive: Path) -> Finding:
    from impactd.data_lock import DataLock, DataLockedError
    from impactd.storage import rescue

    name = "rescue mark"
    runs = False
    if archive.exists():
        try:
            DataLock(archive).release()
        except DataLockedError:
            runs = True
    marks = rescue.read_marks(place, archive)
    ended = marks[1:] if runs else marks  # the newest is that of the daemon that runs
    if ended:
        said = f"a file that the daemon wrote on {ended[0].utc} survived its end"
        return Finding(name, True, said)
    if runs and marks:
        said = f"the running daemon left one on {marks[0].utc}; none is of an earlier run"
    else:
        said = f"there is none in {place}: no daemon has run with it yet, or its files are removed"
    mend = "Start the daemon, stop it, and run this again: the mark must be there."
    return Finding(name, True, said, mend)


def _disk(folder: Path) -> int:
    there = next(part for part in (folder, *folder.absolute().parents) if part.exists())
    return there.stat().st_dev
