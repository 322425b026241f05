"""Alarms: what went wrong, until somebody says that it was seen."""

from __future__ import annotations

from dataclasses import asdict

from fastapi import APIRouter

from impactd.alarms import guidance_of, severity_of
from impactd.api.own_commands import as_typed_here
from impactd.api.schemas import Number
from impactd.api.security import TheCaller, TheDaemon
from impactd.storage.alarms import Alarm
from impactd.wire.rig_answers import AlarmAnswer, AlarmPage

router = APIRouter(prefix="/v1/alarms", tags=["rig"])


@router.get("")
def list_alarms(daemon: TheDaemon) -> AlarmPage:
    """List the open alarms, and the last ones that were acknowledged; a restart ends none."""
    table = daemon.archive.alarms
    return AlarmPage(
        open=[_answer(alarm, daemon.own_options) for alarm in table.open()],
        acknowledged=[_answer(alarm, daemon.own_options) for alarm in table.acknowledged()],
    )


@router.post("/{number}/acknowledge")
def acknowledge_alarm(number: Number, daemon: TheDaemon, caller: TheCaller) -> AlarmAnswer:
    """Say that an alarm was seen; this does not clear a fault of the rig."""
    return _answer(daemon.alarms.acknowledge(number, by=caller.name), daemon.own_options)


def _answer(alarm: Alarm, options: str) -> AlarmAnswer:
    return AlarmAnswer(
        **asdict(alarm),
        severity=severity_of(alarm.kind),
        guidance=[as_typed_here(one, options) for one in guidance_of(alarm.kind, alarm.remedy)],
    )
