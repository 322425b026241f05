"""Failures of a drop as problems with a remedy.

One table says for each error of a driver or of the archive how it is called outside, and whether
it puts the rig itself in doubt. A lost or disobedient device does; a missed trigger does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from drivers.digitizer import Record
from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DisobeyedError,
    DriverError,
    FirmwareError,
    OverrunError,
    ProtocolError,
    RecordError,
    SelfTestError,
    TriggerTimeoutError,
)
from impactd.storage.errors import ArchiveError, StorageFullError
from impactd.storage.problem import Problem


class Doubt(Enum):
    """How far a failure reaches."""

    NONE = "the drop is lost, the rig works"
    RETRY = "a device cannot be reached; it is tried again"
    PERSON = "the rig did not obey; somebody must look at it before it moves again"


class StepFailedError(Exception):
    """A step of a drop cannot go on; ``record`` is evidence."""

    def __init__(
        self, problem: Problem, *, doubt: Doubt = Doubt.NONE, record: Record | None = None
    ) -> None:
        self.problem = problem
        self.doubt = doubt
        self.record = record
        super().__init__(f"{problem.detail} {problem.remedy}".strip())


class RescuedError(Exception):
    """The daemon ends with a record that only another disk took; its drop ends at next start."""

    def __init__(self, path: Path) -> None:
        self.path = path
        super().__init__(f"The record is kept in {path} until the next start.")


@dataclass(frozen=True)
class Failure:
    """A failed drop."""

    problem: Problem
    doubt: Doubt
    record: Record | None = None
    """The part of the record that exists: evidence, never a shot."""


@dataclass(frozen=True)
class _Kind:
    type: str
    title: str
    status: int
    doubt: Doubt


# A subclass stands before its base: the first match counts.
_KINDS: dict[type[Exception], _Kind] = {
    AbortedError: _Kind("aborted", "Drop aborted", 409, Doubt.NONE),
    TriggerTimeoutError: _Kind("no-impact", "No impact was seen", 504, Doubt.NONE),
    OverrunError: _Kind("overrun", "Samples were lost", 500, Doubt.NONE),
    RecordError: _Kind("bad-record", "The record must not be used", 500, Doubt.NONE),
    DeviceLostError: _Kind("device-lost", "A device was lost", 503, Doubt.RETRY),
    DeviceNotFoundError: _Kind("device-not-found", "A device does not answer", 503, Doubt.RETRY),
    DeviceBusyError: _Kind("device-busy", "A device is in other hands", 503, Doubt.RETRY),
    DeviceTimeoutError: _Kind(
        "device-timeout", "A device did not answer in time", 504, Doubt.RETRY
    ),
    SelfTestError: _Kind("self-test", "A device failed its self-test", 500, Doubt.RETRY),
    # A relay that does not follow may hold nothing or let go of nothing: somebody must look.
    DisobeyedError: _Kind(
        "device-protocol", "A device did not do what it was told", 500, Doubt.PERSON
    ),
    # A stalled endpoint or a garbled reply mends itself by opening and asking again.
    ProtocolError: _Kind(
        "device-protocol", "A device did not do what it was told", 500, Doubt.RETRY
    ),
    FirmwareError: _Kind("firmware", "The firmware cannot be loaded", 500, Doubt.RETRY),
    ConfigurationError: _Kind(
        "configuration", "The settings do not fit the device", 500, Doubt.PERSON
    ),
    DriverError: _Kind("device", "A device failed", 500, Doubt.RETRY),
    StorageFullError: _Kind("disk-full", "The disk is full", 507, Doubt.NONE),
    ArchiveError: _Kind("storage", "The shot could not be stored", 500, Doubt.NONE),
}


def failure_of(error: Exception) -> Failure:
    """Return what an error of a step means for the drop and for the rig.

    Anything not foreseen becomes ``internal`` and calls for a person.
    """
    if isinstance(error, StepFailedError):
        return Failure(error.problem, error.doubt, error.record)
    for kind, meaning in _KINDS.items():
        if isinstance(error, kind):
            what = str(getattr(error, "what", error))
            why = str(getattr(error, "why", ""))
            problem = Problem(
                type=meaning.type,
                title=meaning.title,
                status=meaning.status,
                detail=f"{what} {why}".strip(),
                remedy=str(getattr(error, "remedy", "")),
            )
            return Failure(problem, meaning.doubt, getattr(error, "record", None))
    return Failure(
        Problem(
            type="internal",
            title="The daemon failed",
            status=500,
            detail=f"{type(error).__name__}: {error}",
            remedy="This is a defect: report it with the lines of `journalctl -u impactd`.",
        ),
        Doubt.PERSON,
    )
