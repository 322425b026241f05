"""The status: READY or NOT READY, why, and what to do, in one sentence."""

from __future__ import annotations

from dataclasses import dataclass

from impactd.acquisition.failures import Doubt, Failure
from impactd.acquisition.preflight import CalibrationState, Check
from impactd.acquisition.transitions import BUSY, State


@dataclass(frozen=True)
class ServiceStatus:
    """The status of the rig, for people and programs."""

    ready: bool
    """Whether a drop asked for now would begin."""
    sentence: str
    """Starts with ``READY`` or ``NOT READY``."""
    state: str
    owner: str | None
    """Who holds the rig."""
    drop: int | None
    """The drop under way."""
    checks: tuple[Check, ...]
    calibration: CalibrationState
    alarms: tuple[str, ...]
    """What needs attention although drops are possible."""
    attention: str = ""
    """What to check before the next sphere is hung; empty when nothing."""


@dataclass(frozen=True)
class Facts:
    """The values that the sentence is made of, all read at one time."""

    state: State
    owner: str | None
    """Who holds the rig."""
    drop: int | None
    """The drop under way."""
    doing: str
    """What that drop does now."""
    fault: Failure | None
    """Why the rig is in doubt."""
    retry_s: float
    """Pause between attempts to reach a lost device. [s]"""
    checks: tuple[Check, ...]
    calibration: CalibrationState
    alarms: tuple[str, ...]
    aftermath: str = ""
    """What to check after the last drop."""


def status_of(facts: Facts) -> ServiceStatus:
    """Return the status."""
    why_not = _why_not(facts)
    if why_not:
        sentence = f"NOT READY: {why_not}"
    else:
        sphere = next((c.sentence for c in facts.checks if c.name == "sphere"), "")
        parts = facts.aftermath, sphere, facts.calibration.sentence
        found = "; ".join(part for part in parts if part)
        sentence = f"READY: ask for a drop ({found})."
    return ServiceStatus(
        ready=not why_not,
        sentence=sentence,
        state=facts.state.value,
        owner=facts.owner,
        drop=facts.drop,
        checks=facts.checks,
        calibration=facts.calibration,
        alarms=facts.alarms,
        attention="" if why_not else facts.aftermath,
    )


_ABOUT_STATE = {
    State.STOPPED: "the acquisition is not running; start the daemon.",
    State.CONNECTING: "digitizer and valve are being opened and tested; wait a few seconds.",
}


def _why_not(facts: Facts) -> str:
    if facts.state in _ABOUT_STATE:
        return _ABOUT_STATE[facts.state]
    if facts.state is State.FAULT:
        return _about_fault(facts.fault, facts.retry_s)
    if facts.state in BUSY and facts.drop is not None:
        # Not "of": drop 14 of a calibration is not its fourteenth.
        who = f"drop {facts.drop}, for {facts.owner},"
        return f"{who} {facts.doing}; wait until it ends, or abort it."
    if facts.owner is not None:
        return f"{facts.owner} has reserved the rig; wait until it ends, or abort it."
    refusal = next((check for check in facts.checks if not check.ok), None)
    if refusal is not None:
        remedy = f" {refusal.remedy}" if refusal.remedy else ""
        return f"{refusal.sentence}.{remedy}"
    return ""


def _about_fault(fault: Failure | None, retry_s: float) -> str:
    if fault is None:
        return "the state of the rig is uncertain; check it, then acknowledge the fault."
    what = f"{fault.problem.detail} {fault.problem.remedy}".strip()
    if fault.doubt is Doubt.PERSON:
        return f"{what} Then acknowledge the fault."
    return f"{what} It is tried again every {retry_s:g} s."
