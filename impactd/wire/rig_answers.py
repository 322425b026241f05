"""The rig itself as the API answers for it: light, alarms, log, calibrations, diagnoses."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field

from impactd.wire.answers import Answer, ProblemMember


class SessionAnswer(Answer):
    """Whose token or session this is."""

    name: str = Field(description="Of the token.")
    scope: str = Field(description="`read`, `operate` or `admin`.")
    csrf: str | None = Field(
        description="For `X-CSRF-Token` on all that writes with a cookie; null without one."
    )


class SignInCodeAnswer(Answer):
    """A code that signs one browser in, once."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {"code": "K7QW-9M2D", "life_s": 300, "name": "ada", "scope": "operate"}
        }
    )
    code: str = Field(description="Two groups of four; only its hash is kept.")
    life_s: float = Field(description="How long it is valid from now. [s]")
    name: str = Field(description="Of the token that made it, and that its session acts for.")
    scope: str = Field(description="Of that token: `read`, `operate` or `admin`.")


class StatusAnswer(Answer):
    """Whether the rig is ready to drop, and why not where it is not."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "ready": True,
                "sentence": "READY: idle, calibrated, 120 GB free.",
                "state": "IDLE",
                "owner": None,
                "drop": None,
            }
        }
    )
    ready: bool
    sentence: str
    state: str
    owner: str | None
    drop: int | None
    token_command: str | None = Field(
        default=None, description="Makes a token in a shell of the rig's computer; null elsewhere."
    )


class AbortAnswer(Answer):
    """What an abort found and did."""

    aborted: bool
    drop: int | None
    sentence: str
    took_s: float = Field(description="From the abort's turn to valve and digitizer safe. [s]")
    took_ms: float = Field(
        description="From the receipt of the request to valve and digitizer confirmed safe. [ms]"
    )
    safe_after_ms: float = Field(
        description="From the receipt to this answer: what was sent before it moves nothing. [ms]"
    )


class AlarmAnswer(Answer):
    """Something that went wrong."""

    id: int
    kind: str = Field(description="The event that raised it.")
    severity: str = Field(default="minor", description="major stops the work, minor can wait.")
    sentence: str
    remedy: str = Field(description="What its cause needs; may be empty.")
    guidance: list[str] = Field(
        default_factory=list, description="What to do, step by step; begins with the remedy."
    )
    times: int = Field(description="How often it happened while it was open.")
    first_utc: str
    last_utc: str
    acknowledged_utc: str | None
    acknowledged_by: str | None


class AlarmPage(Answer):
    """Alarms, newest first."""

    open: list[AlarmAnswer]
    acknowledged: list[AlarmAnswer]


class LogEntry(Answer):
    """Something that happened."""

    id: int
    utc: str
    kind: str = Field(description="`request` for what somebody asked for, else an event's kind.")
    data: dict[str, Any]


class LogPage(Answer):
    """The log, newest first."""

    items: list[LogEntry]
    next: str | None


class CalibrationAnswer(Answer):
    """A calibration of the load cell."""

    number: int
    kind: str = Field(description="drops or static_weights")
    state: str = Field(description="requested, running, fitting, done or failed")
    slot: str | None
    owner: str
    plan: list[dict[str, Any]]
    drops: list[int]
    result: dict[str, Any] | None
    problem: ProblemMember | None
    requested_utc: str
    finished_utc: str | None
    valid_until_utc: str | None
    links: dict[str, str | None]


class CalibrationPage(Answer):
    """Calibrations, newest first."""

    items: list[CalibrationAnswer]
    series: list[dict[str, Any]] = Field(
        description="Gain, frequency and damping of the calibrations with drops on this page, "
        "oldest first, with their drift since the one before and since the first."
    )
    next: str | None


class DiagnosisProgress(Answer):
    """How far a running diagnosis is."""

    text: str
    share: float = Field(description="Of the present stage, 0..1.")


class DiagnosisAnswer(Answer):
    """A diagnosis that was asked for."""

    id: int
    state: str = Field(description="queued, running, done, failed or cancelled")
    subject: str
    reason: str | None
    verdict: str | None = Field(description="Null until it is done.")
    sentence: str | None
    model: dict[str, Any] | None = Field(
        description="Name and version of the model that was accepted; null where none was."
    )
    progress: DiagnosisProgress | None
    created_utc: str
    finished_utc: str | None
    result: dict[str, Any] | None = Field(description="impactd-diagnosis/1; not in lists.")
    links: dict[str, str | None] = Field(
        description="`next_drop` takes a POST where the diagnosis proposes a drop."
    )


class DiagnosisPage(Answer):
    """Diagnoses, newest first."""

    items: list[DiagnosisAnswer]
