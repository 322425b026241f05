"""Fits: asking for one beyond the automatic one, and its result."""

from __future__ import annotations

from fastapi import APIRouter, Response

from impactd.api.answers import fit_job_answer
from impactd.api.client_keys import FIT, job_key
from impactd.api.schemas import FitBody, Key, Number
from impactd.api.security import TheCaller, TheDaemon
from impactd.wire.answers import FitJobAnswer

router = APIRouter(prefix="/v1/fits", tags=["fits"])


@router.post("", status_code=202)
def request_fit(
    body: FitBody, response: Response, daemon: TheDaemon, caller: TheCaller, key: Key = None
) -> FitJobAnswer:
    """Fit shots again: one by itself, several together."""
    job = daemon.request_fit(body.shots, body.model, key=job_key(caller, FIT, key))
    response.headers["Location"] = f"/v1/fits/{job.id}"
    return fit_job_answer(job, daemon.archive.fits.of_job(job.id))


@router.get("/{fit_id}")
def show_fit(fit_id: Number, daemon: TheDaemon) -> FitJobAnswer:
    """Show a fit that was asked for: queued, running, done or failed with the reason."""
    job = daemon.archive.jobs.get(fit_id)
    return fit_job_answer(job, daemon.archive.fits.of_job(fit_id))
