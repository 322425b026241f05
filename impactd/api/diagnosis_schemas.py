"""Diagnoses and models over the wire."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field

from analysis.base_models import DEFAULT_BASE
from impactd.api.environment_schema import EnvironmentBody
from impactd.api.finite import without_nan
from impactd.api.schemas import Name, Request, once
from impactd.storage.jobs import Job
from impactd.wire.rig_answers import DiagnosisAnswer, DiagnosisProgress

LARGEST = 2**53 - 1  # the largest integer every JSON reader keeps exact


class DiagnosisBody(Request):
    """Shots whose fit is to be explained."""

    model_config = ConfigDict(
        json_schema_extra={"example": {"shots": [17, 18, 19, 20], "base": "kv2"}}
    )
    shots: Annotated[
        list[Annotated[int, Field(ge=1, le=LARGEST)]],
        Field(min_length=1, max_length=500),
        AfterValidator(once),
    ]
    base: Literal["kv2", "kv", "hsd"] = DEFAULT_BASE
    budget_s: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = Field(
        None,
        description="How long it may search once it runs [s]; then the best verdict so far, and "
        "`ended_early` in the result. Without it, to the end.",
    )


class NextDropBody(Request):
    """Who hangs the sphere that a diagnosis asks for."""

    model_config = ConfigDict(json_schema_extra={"example": {"operator": "ab"}})
    operator: Name = Field(description="Who hangs the sphere.")
    environment: EnvironmentBody | None = Field(None, description="As for `POST /v1/drops`.")


class ActiveModelBody(Request):
    """The model that new results are reported with."""

    model_config = ConfigDict(json_schema_extra={"example": {"name": "kv2"}})
    name: Annotated[str, Field(min_length=1, max_length=200)]
    version: Annotated[int, Field(ge=1, le=LARGEST)] | None = Field(
        None, description="Of a named model; the latest one without it."
    )


def diagnosis_answer(
    job: Job, progress: tuple[str, float] | None, *, whole: bool = True
) -> DiagnosisAnswer:
    """Return a diagnosis that was asked for; ``whole`` with its result."""
    result = job.result or {}
    found = result.get("diagnosis")
    at = f"/v1/diagnoses/{job.id}"
    proposes = found is not None and found.get("next_drop") is not None
    told = None
    if progress is not None:
        told = DiagnosisProgress(text=progress[0], share=progress[1])
    return DiagnosisAnswer(
        id=job.id,
        state=job.state,
        subject=job.subject,
        reason=job.reason,
        verdict=found["verdict"] if found else None,
        sentence=found["sentence"] if found else None,
        model=result.get("model"),
        progress=told,
        created_utc=job.created_utc,
        finished_utc=job.finished_utc,
        result=without_nan(found) if whole else None,
        links={
            "self": at,
            "report": f"{at}/report.html" if found else None,
            "report_pdf": f"{at}/report.pdf" if found else None,
            "next_drop": f"{at}/next-drop" if proposes else None,
        },
    )
