"""The log: what happened and who asked for it, newest first."""

from __future__ import annotations

from typing import Literal

from fastapi import APIRouter

from impactd.api.answers import next_page
from impactd.api.audit import REQUEST
from impactd.api.finite import without_nan
from impactd.api.schemas import Before, Limit
from impactd.api.security import TheDaemon
from impactd.wire.rig_answers import LogEntry, LogPage

router = APIRouter(prefix="/v1/log", tags=["rig"])

_PEOPLE = (REQUEST,)
_RESULTS = (
    "drop.stored",
    "drop.failed",
    "drop.aborted",
    "drop.interrupted",
    "calibration.done",
    "calibration.failed",
    "diagnosis.done",
    "job.failed",
    "job.cancelled",
    "model.chosen",
    "rig.fault",
    "rig.abort",
    "rig.acknowledged",
    "alarm.acknowledged",
)


@router.get("")
def show_log(
    daemon: TheDaemon,
    about: Literal["people", "results", "both"] = "both",
    limit: Limit = 50,
    before: Before = None,
) -> LogPage:
    """Show who asked for what (`request`), and what came of it."""
    kinds = {"people": _PEOPLE, "results": _RESULTS, "both": (*_PEOPLE, *_RESULTS)}[about]
    found = daemon.archive.events.latest(limit=limit, before=before, kinds=kinds)
    return LogPage(
        items=[
            LogEntry(id=one.id, utc=one.utc, kind=one.kind, data=without_nan(one.data))
            for one in found
        ],
        next=next_page("/v1/log", [one.id for one in found], limit, {"about": about}),
    )
