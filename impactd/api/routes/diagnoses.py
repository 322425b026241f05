"""Diagnoses: closing the loop on stored shots."""

from __future__ import annotations

import anyio
from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse

from impactd.api.arrivals import Accepted
from impactd.api.client_keys import DIAGNOSIS, job_key
from impactd.api.diagnosis_schemas import DiagnosisBody, NextDropBody, diagnosis_answer
from impactd.api.problems import ProblemError
from impactd.api.routes.drops import begin_drop, environment_of, required_key
from impactd.api.schemas import Key, Limit, Number
from impactd.api.security import Limits, TheCaller, TheDaemon
from impactd.daemon import Daemon
from impactd.reports.charts import REPORT_POLICY, with_library
from impactd.storage.drops import DropRequest
from impactd.storage.jobs import DIAGNOSE, Job
from impactd.wire.answers import DropAnswer
from impactd.wire.rig_answers import DiagnosisAnswer, DiagnosisPage

router = APIRouter(prefix="/v1/diagnoses", tags=["diagnoses"])


@router.post("", status_code=202)
def request_diagnosis(
    body: DiagnosisBody,
    response: Response,
    daemon: TheDaemon,
    caller: TheCaller,
    key: Key = None,
) -> DiagnosisAnswer:
    """Find out what a model misses on these shots, name it, and what adding it changes."""
    asked = job_key(caller, DIAGNOSIS, key)
    job = daemon.request_diagnosis(body.shots, body.base, budget_s=body.budget_s, key=asked)
    response.headers["Location"] = f"/v1/diagnoses/{job.id}"
    return diagnosis_answer(job, daemon.jobs.progress(job.id))


@router.get("")
def list_diagnoses(daemon: TheDaemon, limit: Limit = 50) -> DiagnosisPage:
    """List the latest diagnoses, newest first, without their results."""
    jobs = daemon.archive.jobs.list(kind=DIAGNOSE, limit=limit)
    return DiagnosisPage(
        items=[diagnosis_answer(job, daemon.jobs.progress(job.id), whole=False) for job in jobs]
    )


@router.get("/{diagnosis_id}")
def show_diagnosis(diagnosis_id: Number, daemon: TheDaemon) -> DiagnosisAnswer:
    """Show a diagnosis: how far it is, or what it found."""
    job = _job(daemon, diagnosis_id)
    return diagnosis_answer(job, daemon.jobs.progress(job.id))


@router.delete("/{diagnosis_id}", status_code=202)
def cancel_diagnosis(diagnosis_id: Number, daemon: TheDaemon) -> DiagnosisAnswer:
    """Cancel a diagnosis that waits or runs; one that has ended stays."""
    _job(daemon, diagnosis_id)
    job = daemon.jobs.cancel(diagnosis_id)
    return diagnosis_answer(job, daemon.jobs.progress(job.id), whole=False)


@router.post("/{diagnosis_id}/next-drop", status_code=202)
def make_next_drop(  # noqa: PLR0917 - the framework fills them by name
    diagnosis_id: Number,
    body: NextDropBody,
    response: Response,
    daemon: TheDaemon,
    caller: TheCaller,
    accepted: Accepted,
    key: Key = None,
) -> DropAnswer:
    """Make the drop that a diagnosis asks for; the answer is that of `POST /v1/drops`.

    Hang the sphere that `result.next_drop` names first. 409 where the diagnosis proposes none.
    """
    required_key(key, "drop a sphere")
    job = _job(daemon, diagnosis_id)
    found = (job.result or {}).get("diagnosis")
    proposed = found.get("next_drop") if found else None
    if proposed is None:
        is_what = f"found {found['verdict']!r} and proposes no drop" if found else f"is {job.state}"
        raise ProblemError(
            "conflict",
            f"Diagnosis {diagnosis_id} {is_what}.",
            remedy=(
                "A drop is proposed only by a finished diagnosis that confuses effects and "
                "has found a drop that distinguishes them. Request any other drop with POST "
                "/v1/drops."
            ),
            state=job.state,
        )
    asked = DropRequest(
        str(proposed["sphere"]),
        str(proposed["surface"]),
        float(proposed["drop_height_m"]),
        body.operator,
        environment_of(body.environment),
    )
    return begin_drop(asked, response, daemon, caller, key, accepted)


@router.get("/{diagnosis_id}/report.html", response_class=HTMLResponse)
def report(diagnosis_id: Number, daemon: TheDaemon) -> HTMLResponse:
    """Show a diagnosis as a page that is complete in itself."""
    job = _job(daemon, diagnosis_id)
    if job.result is None:
        raise ProblemError("not-found", f"Diagnosis {diagnosis_id} is {job.state}; no report yet.")
    page = with_library(job.result["report_html"])
    return HTMLResponse(page, headers={"Content-Security-Policy": REPORT_POLICY})


@router.get("/{diagnosis_id}/report.pdf", response_class=Response)
async def report_pdf(request: Request, diagnosis_id: Number, daemon: TheDaemon) -> Response:
    """Show the result of a diagnosis on one page for the file."""
    limits: Limits = request.app.state.limits
    job = await anyio.to_thread.run_sync(_job, daemon, diagnosis_id)
    if job.result is None:
        raise ProblemError("not-found", f"Diagnosis {diagnosis_id} is {job.state}; no report yet.")
    made = await anyio.to_thread.run_sync(daemon.result_sheet, job, limiter=limits.apart)
    return Response(made, media_type="application/pdf")


def _job(daemon: Daemon, number: int) -> Job:
    job = daemon.archive.jobs.get(number)
    if job.kind != DIAGNOSE:
        raise ProblemError("not-found", f"There is no diagnosis {number}.")
    return job
