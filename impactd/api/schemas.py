"""The bodies of requests, with examples for OpenAPI; answers are in `impactd.wire`.

Requests are strict: unknown members, text for numbers, NaN and infinity are refused.
Numbers carry their unit in their name, SI throughout.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from fastapi import Header, Path, Query
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from analysis.base_models import DEFAULT_BASE
from impactd.api.environment_schema import EnvironmentBody
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


class SignInBody(Request):
    """A sign-in code, as somebody typed it."""

    model_config = ConfigDict(json_schema_extra={"example": {"code": "K7QW-9M2D"}})
    code: str = Field(
        min_length=1, max_length=64, description="Case, spaces and hyphens do not count."
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


def once(shots: list[int]) -> list[int]:
    """Refuse a shot that is named twice: it would count as two drops."""
    twice = next((one for one in shots if shots.count(one) > 1), None)
    if twice is not None:
        raise ValueError(f"shot {twice} is named twice, and would count as two drops")
    return shots


class FitBody(Request):
    """Shots to fit again, together when there are several."""

    model_config = ConfigDict(json_schema_extra={"example": {"shots": [17, 18], "model": "kv2"}})
    shots: Annotated[
        list[Annotated[int, Field(ge=1, le=_LARGEST)]],
        Field(min_length=1, max_length=500),
        AfterValidator(once),
    ]
    model: Annotated[str, Field(min_length=1, max_length=200)] = DEFAULT_BASE


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
