"""Uploaded recordings as the API answers them."""

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field

from impactd.wire.answers import Answer
from impactd.wire.rig_answers import DiagnosisAnswer


class RecordedFile(Answer):
    """An uploaded file."""

    name: str
    size_bytes: int


class RecordingsAnswer(Answer):
    """Files that were recorded together."""

    name: str
    files: list[RecordedFile] = Field(description="In the order in which they are read.")
    choices: dict[str, Any] = Field(description="As stated last, to read the files with.")
    values: dict[str, Any] | None = Field(description="As stated last; null before.")
    diagnoses: list[DiagnosisAnswer] = Field(description="Newest first, without their results.")
    links: dict[str, str | None]


class StatedValues(Answer):
    """What was stated of recordings."""

    values: dict[str, Any] = Field(description="With `shots` by the names that the table gives.")


class RecordingsPage(Answer):
    """Uploaded recordings, newest first."""

    items: list[RecordingsAnswer]


class RecordedHit(Answer):
    """A hit in a recording: a shot, when the recordings are fitted."""

    model_config = ConfigDict(
        json_schema_extra={
            "example": {
                "name": "drop-1",
                "file": "drop-1.csv",
                "quantity": "voltage",
                "sample_rate_Hz": 1e6,
                "trigger_index": 1992,
                "starts_s": 0.001992,
                "peak": 3.71,
                "contact_s": 1.02e-4,
                "blows": 1,
                "remark": "",
            }
        }
    )
    name: str
    file: str
    quantity: str = Field(description="`voltage`, `force_N` or `acceleration_m_per_s2`.")
    sample_rate_Hz: float  # noqa: N815 - the unit as it is written
    trigger_index: int = Field(description="Sample of the shot at which the contact begins.")
    starts_s: float = Field(description="The contact, from the start of the recording. [s]")
    peak: float = Field(description="Largest excursion, in V, N or m/s^2.")
    contact_s: float
    blows: int = Field(description="Hits that are kept in this shot, as no pause parts them.")
    remark: str = Field(description="What a person should look at; may be empty.")


class ReadingAnswer(Answer):
    """What was read in recordings."""

    shots: list[RecordedHit]
    assumptions: list[str]
    missing: list[str] = Field(description="What a modulus needs and nobody has stated, by line.")
    links: dict[str, str | None]
