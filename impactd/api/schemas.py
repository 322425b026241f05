"""What goes over the wire: one model per request and per answer, with examples for OpenAPI.

Requests are strict: unknown members, text for numbers, NaN and infinity are refused.
Numbers carry their unit in their name, SI throughout.
"""

from __future__ import annotations

import re
from typing import Annotated, Any, Literal

from fastapi import Header, Path, Query
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from analysis.base_models import DEFAULT_BASE
from impactd.api.environment_schema import EnvironmentBody, EnvironmentMembers
from impactd.storage.plain_text import find_forbidden

_LARGEST = 2**53 - 1  # the largest integer every JSON reader keeps exact

Number = Annotated[int, Path(ge=1, le=_LARGEST, description="A short number, from 1.")]
Limit = Annotated[int, Query(ge=1, le=200, description="At most so many items.")]
Before = Annotated[
    int | None,
    Query(ge=1, le=_LARGEST, description="Only numbers below this one; take `next` from a page."),
]
Moment = Annotated[
    str | None,
    Query(
        max_length=40, description="ISO 8601; without a zone it is UTC.", examples=["2026-03-01"]
    ),
]


def _visible(text: str) -> str:
    found = find_forbidden(text)
    if found is not None:
        raise ValueError(f"no name may hold {found}")
    return text


Name = Annotated[str, Field(min_length=1, max_length=64), AfterValidator(_visible)]
Key = Annotated[
    str | None,
    Header(
        alias="Idempotency-Key",
        min_length=1,
        max_length=200,
        description="A fresh random value per request; the same value on a repetition.",
        examples=["6f1f0c5e-4c0e-4a8a-9c57-7d8f8d5f3c11"],
    ),
]


class Request(BaseModel):
    """A body: strict, and nothing unknown in it."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)


class Answer(BaseModel):
    """An answer; later versions may add members."""

    model_config = ConfigDict(extra="allow")


class SessionAnswer(Answer):
    """Whose token or session this is."""

    name: str = Field(description="Of the token.")
    scope: str = Field(description="`read`, `operate` or `admin`.")
    csrf: str | None = Field(
        description="For `X-CSRF-Token` on all that writes with a cookie; null without one."
    )


class DropBody(Request):
    """A drop somebody asks for."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "sphere": "acetal",
                "surface": "polycarbonate",
                "drop_height_m": 0.047,
                "operator": "ab",
            }
        }
    )
    sphere: Name = Field(description="Name in the materials file.")
    surface: Name = Field(description="Name in the materials file.")
    drop_height_m: float = Field(gt=0, le=5, description="Lowest point of the sphere above it. [m]")
    operator: Name = Field(description="Who hangs the sphere.")
    environment: EnvironmentBody | None = Field(
        None, description="As the technician read it; it counts instead of the settings' way."
    )


class ReboundBody(Request):
    """How high a sphere came back, as somebody saw it."""

    model_config = ConfigDict(
        json_schema_extra={"example": {"rebound_height_m": 0.031, "u_rebound_height_m": 0.0005}}
    )
    rebound_height_m: float = Field(
        gt=0, le=5, description="Of the sphere's lowest point above the surface. [m]"
    )
    u_rebound_height_m: float = Field(gt=0, le=5, description="Standard uncertainty. [m]")


class ProblemMember(Answer):
    """Why something failed, as in an RFC 9457 document."""

    type: str
    title: str
    status: int
    detail: str
    remedy: str


class DropAnswer(Answer):
    """A drop and how far it came."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "number": 17,
                "state": "analysed",
                "shot": 17,
                "problem": None,
                "sphere": "acetal",
                "surface": "polycarbonate",
                "drop_height_m": 0.047,
                "operator": "ab",
                "owner": "ab (bench)",
                "calibration": None,
                "requested_utc": "2026-03-01T12:00:00.000000Z",
                "updated_utc": "2026-03-01T12:00:01.700000Z",
                "links": {"self": "/v1/drops/17", "shot": "/v1/shots/17"},
            }
        }
    )
    number: int
    state: str = Field(
        description="requested, arming, armed, released, capturing, storing, then one of stored, "
        "analysed, failed, aborted, interrupted"
    )
    shot: int | None
    problem: ProblemMember | None
    sphere: str
    surface: str
    drop_height_m: float
    operator: str
    environment: EnvironmentMembers = None
    owner: str
    calibration: int | None
    rebound_height_m: float | None = Field(None, description="As somebody entered it. [m]")
    u_rebound_height_m: float | None = None
    requested_utc: str
    updated_utc: str
    links: dict[str, str | None]


class FitAnswer(Answer):
    """One result of the analysis."""

    id: int
    shot: int | None
    model: str
    calibration: int | None
    created_utc: str
    result: dict[str, Any]


class RepetitionsAnswer(Answer):
    """A shot beside earlier shots of the same sphere, surface and height, right after the drop."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "shots": [13, 14, 15, 16],
                "unlike": True,
                "sentence": "it is unlike its 4 repetitions. It is like hdpe on aluminium, not "
                "acetal on aluminium: look at the label.",
                "likely": [{"sphere": "hdpe"}],
                "size": 0.72,
                "duration": 1.31,
                "shape": 0.021,
            }
        }
    )
    shots: list[int] = Field(description="The repetitions; fewer than two are none.")
    unlike: bool = Field(description="Whether it differs from them by more than they scatter.")
    sentence: str = Field(description="What to look at, in words; empty for nothing.")
    likely: list[dict[str, str | float]] = Field(
        description="What it is like, the likeliest first: sphere and surface, drop_height_m [m], "
        "or gain [1]."
    )
    size: float | None = Field(None, description="Of its signal over theirs. [1]")
    duration: float | None = Field(None, description="The same of its length in time. [1]")
    shape: float | None = Field(
        None, description="What their mean leaves of it, rms over its peak. [1]"
    )


class ShotAnswer(Answer):
    """A stored shot; the raw samples are in its file."""

    number: int
    sphere: str | None
    surface: str | None
    drop_height_m: float | None
    operator: str
    source: str
    started_utc: str
    stored_utc: str
    quantity: str
    sample_rate_hz: float
    samples: int
    trigger_index: int
    peak: float
    clipped: bool
    environment: EnvironmentMembers = None
    sha256: str
    size_bytes: int
    links: dict[str, str | None]
    fits: list[FitAnswer] | None = Field(None, description="The latest of each model.")
    advice: Literal["use", "check", "repeat"] | None = None
    reasons: list[str] | None = Field(None, description="Why not `use`, for programs.")
    because: list[str] | None = Field(None, description="The same reasons in words, for people.")
    repetitions: RepetitionsAnswer | None = Field(
        None, description="Null until they were looked at, for an import, and in plain lists."
    )
    reduced_modulus_Pa: dict[str, Any] | None = Field(  # noqa: N815 - the unit's own capital
        None, description="Of the fit that speaks for the shot; in lists with `summary`."
    )
    model: str | None = Field(None, description="Of that fit.")


class TraceAnswer(Answer):
    """A trace thinned for drawing: each stretch is kept by its smallest and largest sample."""

    number: int
    quantity: str
    unit: str
    start_s: float = Field(description="First moment, from the trigger. [s]")
    stop_s: float
    samples: int = Field(description="Recorded samples between start and stop.")
    decimated: bool
    time_s: list[float]
    signal: list[float]


class FitBody(Request):
    """Shots to fit again, together when there are several."""

    model_config = ConfigDict(json_schema_extra={"example": {"shots": [17, 18], "model": "kv2"}})
    shots: list[Annotated[int, Field(ge=1, le=_LARGEST)]] = Field(min_length=1, max_length=500)
    model: Annotated[str, Field(min_length=1, max_length=200)] = DEFAULT_BASE


class FitJobAnswer(Answer):
    """A fit that was asked for."""

    id: int
    state: str = Field(description="queued, running, done or failed")
    kind: str
    subject: str
    attempts: int
    reason: str | None
    created_utc: str
    finished_utc: str | None
    fits: list[FitAnswer]
    result: dict[str, Any] | None
    links: dict[str, str | None]


class PlanItem(Request):
    """Drops of one reference sphere on one reference surface."""

    sphere: Name
    surface: Name
    drop_height_m: float = Field(gt=0, le=5, description="[m]")
    repeats: int = Field(3, ge=1, le=100)


class WeightReading(Request):
    """A weight on the load cell and what it read."""

    mass_kg: float = Field(ge=0, le=1000, description="0 is the empty cell. [kg]")
    volts: float = Field(ge=-1000, le=1000, description="[V]")
    u_volts: float | None = Field(
        None, gt=0, le=1000, description="Standard uncertainty; for all readings or for none. [V]"
    )


class CalibrationBody(Request):
    """A calibration somebody, or the timer, asks for: a series of drops, or weights as read."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {"slot": "2026-W09", "unattended": False, "plan": None},
                {
                    "method": "static_weights",
                    "readings": [
                        {"mass_kg": 0.0, "volts": 0.0003, "u_volts": 0.0001},
                        {"mass_kg": 0.5, "volts": 2.7551, "u_volts": 0.0005},
                        {"mass_kg": 1.0, "volts": 5.5097, "u_volts": 0.0005},
                    ],
                    "hold_time_s": 2.0,
                    "discharge_time_constant_s": 2000.0,
                },
            ]
        }
    )
    method: Literal["drops", "static_weights"] = "drops"
    slot: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_visible)] | None = (
        Field(
            None,
            description="The same slot never runs twice. Without it the Idempotency-Key counts.",
        )
    )
    plan: list[PlanItem] | None = Field(
        None, min_length=1, max_length=100, description="Without it, the plan of the settings."
    )
    unattended: bool = Field(False, description="Nobody stands by the rig.")
    readings: list[WeightReading] | None = Field(
        None, min_length=2, max_length=1000, description="Of `static_weights`, in their order."
    )
    hold_time_s: float | None = Field(
        None, ge=0, le=1e6, description="From putting a weight down to reading it. [s]"
    )
    discharge_time_constant_s: float | None = Field(
        None, gt=0, le=1e9, description="Of cell and conditioner, as far as it is known. [s]"
    )

    @model_validator(mode="after")
    def _one_way_only(self) -> CalibrationBody:
        weights = (self.readings, self.hold_time_s, self.discharge_time_constant_s)
        if self.slot is not None and re.match(r"token \d", self.slot):
            raise ValueError("a slot that begins like `token 1` is kept for Idempotency-Keys")
        if self.method == "drops" and any(given is not None for given in weights):
            raise ValueError("readings and times belong to the method static_weights")
        if self.method == "static_weights":
            if self.readings is None or self.hold_time_s is None:
                raise ValueError("static_weights needs readings and hold_time_s")
            if self.plan is not None or self.unattended:
                raise ValueError("static_weights has no plan of drops")
        return self


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


class StatusAnswer(Answer):
    """The one honest light."""

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


class AlarmAnswer(Answer):
    """Something that went wrong."""

    id: int
    kind: str = Field(description="The event that raised it.")
    sentence: str
    remedy: str
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


class CurveAnswer(Answer):
    """What one model makes of a shot, over the stretch that was fitted."""

    fit: int
    model: str
    start_s: float = Field(description="First moment, from the trigger. [s]")
    interval_s: float = Field(description="From sample to sample. [s]")
    signal: list[float]


class CurvesAnswer(Answer):
    """The models' curves of a shot; as its trace, in the unit of its signal."""

    number: int
    unit: str
    items: list[CurveAnswer]
    missing: list[str] = Field(description="Models whose fit has kept no curve.")


class DropPage(Answer):
    """Drops, newest first."""

    items: list[DropAnswer]
    next: str | None = Field(description="Path of the next page, null on the last one.")


class ShotPage(Answer):
    """Shots, newest first."""

    items: list[ShotAnswer]
    next: str | None


class CalibrationPage(Answer):
    """Calibrations, newest first."""

    items: list[CalibrationAnswer]
    series: list[dict[str, Any]] = Field(
        description="Gain, frequency and damping of the calibrations with drops on this page, "
        "oldest first, with their drift since the one before and since the first."
    )
    next: str | None
