"""Every error the archive raises, drawn as one tree.

::

    ArchiveError                    the archive cannot do what it was asked
    ├── StorageFullError            the disk is full, or its reserve would be touched
    ├── NotFoundError               no such drop, shot, fit, job, calibration or token
    ├── CorruptShotError            a shot file does not hold what was written
    ├── InUseError                  it cannot be deleted now
    ├── DropStateError              a drop cannot go from its state to that one
    ├── IdempotencyConflictError    a key was used before, for something else
    └── CampaignError               a campaign folder cannot be used as a whole

Errors of SQLite, HDF5 and the file system are translated where they are met, so that nothing above
the archive needs to know which of them it stands on.
"""

from __future__ import annotations


class ArchiveError(Exception):
    """The archive cannot do what it was asked.

    Parameters
    ----------
    what : str
        What happened, with values and units.
    why : str, optional
        The likeliest cause.
    remedy : str, optional
        What to do about it.
    """

    def __init__(self, what: str, *, why: str = "", remedy: str = "") -> None:
        self.what = what
        self.why = why
        self.remedy = remedy
        super().__init__(" ".join(part for part in (what, why, remedy) if part))


class StorageFullError(ArchiveError):
    """The disk is full, or its reserve would be touched; ``needed_bytes`` includes the reserve."""

    def __init__(self, directory: str, *, free_bytes: int, needed_bytes: int) -> None:
        self.directory = directory
        self.free_bytes = free_bytes
        self.needed_bytes = needed_bytes
        super().__init__(
            f"The disk of {directory} has {free_bytes / 1e6:.1f} MB free and "
            f"{needed_bytes / 1e6:.1f} MB are needed.",
            remedy=(
                "Free space or move the archive (storage.directory); stored files are not affected."
            ),
        )


_LISTED = {
    "shot": "`impactd shots`, or the page under Shots, lists those that are stored.",
    "drop": "GET /v1/drops lists them.",
    "fit": "`impactd shots NUMBER` lists those of a shot.",
    "job": "GET /v1/diagnoses lists those that diagnose.",
    "calibration": "`impactd calibrate --history` lists them.",
    "model": "GET /v1/models lists them.",
    "alarm": "`impactd status` lists those that stand.",
    "token": "`impactd token list` lists them.",
    "recording set": "GET /v1/recordings, or the page under Own recordings, lists them.",
}


class NotFoundError(ArchiveError):
    """Nothing of that kind has that number or name.

    ``kind`` is one of `_LISTED`, which says where those that exist are listed.
    """

    def __init__(self, kind: str, number: int | str) -> None:
        self.kind = kind
        self.number = number
        super().__init__(f"There is no {kind} {number}.", remedy=_LISTED.get(kind, ""))


class CorruptShotError(ArchiveError):
    """A shot file does not hold what was written."""

    def __init__(self, path: str, reason: str) -> None:
        self.path = path
        self.reason = reason
        super().__init__(
            f"The shot file {path} cannot be trusted: {reason}.",
            remedy="Restore it from a backup and run `impactd verify`.",
        )


class InUseError(ArchiveError):
    """Something cannot be deleted while it is worked on."""


class DropStateError(ArchiveError):
    """A drop cannot go from its state to that one."""

    def __init__(self, number: int, state: str, wanted: str) -> None:
        self.number = number
        self.state = state
        self.wanted = wanted
        super().__init__(f"Drop {number} is {state} and cannot become {wanted}.")


class IdempotencyConflictError(ArchiveError):
    """A key was used before, for something else."""

    def __init__(self, key: str, number: int) -> None:
        self.key = key
        self.number = number
        super().__init__(
            f"The idempotency key {key!r} already belongs to number {number} with another body.",
            why="A client used one key for two different requests.",
            remedy="Send a new key with a new request.",
        )


class CampaignError(ArchiveError):
    """A campaign folder cannot be used as a whole.

    Parameters
    ----------
    json_path : str
        Where in ``campaign.json``, e.g. ``$.shots[3].sphere``.
    reason : str
        What is wrong, with values and units.
    """

    def __init__(self, file: str, json_path: str, reason: str) -> None:
        self.file = file
        self.json_path = json_path
        self.reason = reason
        place = file if json_path == "$" else f"{file}, {json_path}"
        super().__init__(f"{place}: {reason}")
