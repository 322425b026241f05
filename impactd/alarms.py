"""Which events are alarms: they stay on the page until somebody acknowledges them.

Each has a severity, a sentence, and guidance: what to do, step by step.

::

    any thread ── Alarms.publish ──> event bus ──> clients
                                └─> archive's table of alarms, when the event is one

A drop that missed its trigger or was aborted is no alarm: whoever asked for it is told.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

import structlog

from impactd.aliases import Json
from impactd.events import EventBus
from impactd.storage.alarms import Alarm, AlarmTable
from impactd.storage.errors import ArchiveError

Words = tuple[str, str]

_log = structlog.get_logger("impactd.alarms")
_CALLING_TYPES = frozenset({"internal", "storage", "disk-full", "overrun", "bad-record"})
"""Failed drops whose reason reaches beyond the drop."""


Severity = Literal["major", "minor"]
_MAJOR = frozenset({"rig.fault", "drop.interrupted", "drop.failed"})
"""What keeps the rig from dropping, or leaves a sphere nobody knows where."""


def severity_of(kind: str) -> Severity:
    """Return the severity of an alarm: ``major`` stops the work, ``minor`` can wait."""
    return "major" if kind in _MAJOR else "minor"


_NEXT: dict[str, tuple[str, ...]] = {
    "rig.fault": (
        "Look at the rig. Where the status asks for it, confirm on the page under Drop that the "
        "rig was checked.",
        "`impactd doctor` tests every part and says how to repair it.",
    ),
    "drop.interrupted": (
        "A series or calibration that it belonged to has ended: begin it again where you need it.",
    ),
    "drop.failed": (
        "The drop left no shot. When the cause is mended, request a new drop.",
        "`impactd doctor` tests disk, data directory and devices.",
    ),
    "calibration.failed": ("The log says how each of its drops ended.",),
    "job.failed": (
        "If it fails again, `journalctl -u impactd` has the lines that whoever maintains it needs.",
    ),
    "job.lost": ("`impactd fit` with the number of the shot does it.",),
    "trigger.early": ("Meanwhile drops continue: each is fitted where its impact is.",),
    "environment.unknown": ("Meanwhile drops continue: give your own readings with each drop.",),
}
"""What is to be done after an alarm's own remedy, whatever its cause was."""


def guidance_of(kind: str, remedy: str) -> list[str]:
    """Return what to do about an alarm, one step a sentence; never empty."""
    return [*filter(None, [remedy]), *_NEXT.get(kind, ("`impactd status` says what is wrong.",))]


class Alarms:
    """The event bus, with a memory for alarms."""

    def __init__(self, bus: EventBus, table: AlarmTable) -> None:
        self._bus = bus
        self._table = table

    def publish(self, kind: str, data: dict[str, Any]) -> None:
        """Publish an event, e.g. ``rig.fault``, from any thread; raise an alarm when it is one."""
        self._bus.publish(kind, data)
        words = alarm_words(kind, data)
        if words is None:
            return
        try:
            alarm = self._table.raise_alarm(kind, *words)
            self._bus.publish("alarm.raised", {"id": alarm.id, "sentence": alarm.sentence})
        except ArchiveError as error:  # what raised it has been told already, and is told once
            _log.warning("an alarm could not be kept", kind=kind, why=error.what)

    def acknowledge(self, number: int, *, by: str) -> Alarm:
        """Acknowledge an alarm; the first acknowledgement counts. Raise NotFoundError."""
        open_before = self._table.get(number).acknowledged_utc is None
        alarm = self._table.acknowledge(number, by)
        if open_before:
            self._bus.publish("alarm.acknowledged", {"id": number, "by": by})
        return alarm


def alarm_words(kind: str, data: dict[str, Any]) -> tuple[str, str] | None:
    """Return sentence and remedy of an alarm, ``None`` for an event that is no alarm."""
    words = _WORDS.get(kind)
    return None if words is None else words(data)


def _rig_fault(data: Json) -> Words:
    return str(data["detail"]), str(data.get("remedy") or "")


def _drop_interrupted(data: Json) -> Words:
    return (
        f"Drop {data['number']} was interrupted by a restart and is not repeated; "
        "see `impactd shots`.",
        "Find the sphere, then request a new drop.",
    )


def _drop_failed(data: Json) -> Words | None:
    if data.get("type") not in _CALLING_TYPES:
        return None
    return f"Drop {data['number']} failed: {data['detail']}", str(data.get("remedy") or "")


def _calibration_failed(data: Json) -> Words | None:
    if data.get("type") in ("aborted", "shutdown"):
        return None
    return (
        f"Calibration {data['number']} failed: {data['reason']}",
        "Correct the named cause, then calibrate again; the previous calibration stays valid.",
    )


def _job_failed(data: Json) -> Words | None:
    if data.get("kind") == "calibrate":  # its run has an alarm already
        return None
    return (
        f"The analysis of {data['subject']} failed: {data['reason']}",
        "The shots are safe. Look at their traces, then request another fit.",
    )


def _job_lost(data: Json) -> Words:
    return (
        f"The fit of shot {data['shot']} could not be queued: {data['detail']}",
        "The shot is safe; request its fit by hand.",
    )


def _trigger_early(_data: Json) -> Words:
    # Without the drop's number, as below.
    return (
        "Something else set off the trigger before an impact.",
        "Look for drift, glitches and vibration of the input, or raise trigger.level_v.",
    )


def _environment_unknown(data: Json) -> Words:
    # Without the drop's number: a sensor that is away is one alarm, counted with each drop.
    return (
        f"Shots are stored without temperature and humidity: {data['detail']}",
        str(data.get("remedy") or ""),
    )


_WORDS: dict[str, Callable[[Json], Words | None]] = {
    "rig.fault": _rig_fault,
    "drop.interrupted": _drop_interrupted,
    "drop.failed": _drop_failed,
    "calibration.failed": _calibration_failed,
    "job.failed": _job_failed,
    "job.lost": _job_lost,
    "trigger.early": _trigger_early,
    "environment.unknown": _environment_unknown,
}
