"""Drops, shots and fits as the API answers them.

Numbers carry their unit in their name, SI throughout.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

EnvironmentMembers = Annotated[
    dict[str, dict[str, float]] | None,
    Field(
        description="`temperature_C` and `relative_humidity`, each with `value` and `u`, as far as "
        "they are known."
    ),
]
"""In answers."""


class Answer(BaseModel):
    """An answer; later versions may add members."""

    model_config = ConfigDict(extra="allow")


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


class DropPage(Answer):
    """Drops, newest first."""

    items: list[DropAnswer]
    next: str | None = Field(description="Path of the next page, null on the last one.")


class FitAnswer(Answer):
    """One result of the analysis."""

    id: int
    shot: int | None
    model: str
    calibration: int | None
    created_utc: str
    result: dict[str, Any]


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
        None, description="Of the fit that speaks for the shot; not in plain lists."
    )
    model: str | None = Field(None, description="Of that fit.")


class ShotPage(Answer):
    """Shots, newest first."""

    items: list[ShotAnswer]
    next: str | None


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
