"""What a person states about uploaded recordings."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Path
from pydantic import AfterValidator, ConfigDict, Field

from impactd.aliases import Json
from impactd.api.schemas import Request
from impactd.storage.plain_text import find_forbidden

_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _plain_name(name: str) -> str:
    found = find_forbidden(name)
    if found is not None or name.startswith(".") or "\\" in name or len(name.encode()) > 200:
        raise ValueError(found or "a file's name has no backslash, no dot in front, and 200 bytes")
    return name


def _no_zero(scale: float) -> float:
    if scale == 0.0:
        raise ValueError("0 leaves nothing of the numbers")
    return scale


SetName = Annotated[
    str,
    Path(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$",
        max_length=64,
        description="Chosen by whoever uploads: letters, digits, _ and -.",
        examples=["acetal-2026-03-01"],
    ),
]
FileName = Annotated[
    str,
    Path(min_length=1, max_length=200, description="With its ending.", examples=["drop-1.csv"]),
    AfterValidator(_plain_name),
]


class ReadingBody(Request):
    """What the files do not say, and what was measured beside them."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "unit": "mV",
                "values": {
                    "spheres": {"acetal": {"radius_m": 0.00476, "mass_kg": 6.116e-4}},
                    "shots": {"drop-1": {"sphere": "acetal", "drop_height_m": 0.0191}},
                },
            }
        }
    )
    rate_Hz: _Positive | None = Field(  # noqa: N815 - the unit as it is written
        None, description="Samples a second, instead of the files'."
    )
    unit: str | None = Field(
        None, max_length=20, description="V, mV, N, kN, g, m/s2, strain ..., instead of the files'."
    )
    columns: list[str] = Field(
        [], max_length=20, description="Names or numbers of the signals; `all` is every one."
    )
    scale: Annotated[float, Field(allow_inf_nan=False), AfterValidator(_no_zero)] = Field(
        1.0, description="Factor from the files' numbers to `unit`; not 0."
    )
    time_unit: Literal["s", "ms", "us", "ns"] | None = Field(
        None, description="What the files' times are in."
    )
    threshold: _Positive | None = Field(None, description="A hit exceeds it; in `unit`.")
    values: dict[str, Any] | None = Field(
        None,
        description="As the file of `impactd new --values`: the keys of campaign.json, and `shots` "
        "by name. `impactd schema campaign` describes them.",
    )

    def choices(self) -> Json:
        """Return how the files are to be read, as `impactd.importing.choices.Choices` has it."""
        return {
            "rate_hz": self.rate_Hz,
            **self.model_dump(include={"unit", "columns", "scale", "time_unit", "threshold"}),
        }


class RecordingsDiagnosisBody(ReadingBody):
    """The same, and how to diagnose."""

    base: Literal["kv2", "kv", "hsd"] | None = Field(
        None, description="Without it kv2, or kv where the records obey that."
    )
    budget_s: _Positive | None = Field(None, description="As for `POST /v1/diagnoses`. [s]")
