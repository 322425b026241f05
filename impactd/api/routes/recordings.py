"""Recordings of any instrument: uploaded, read, and diagnosed like shots."""

from __future__ import annotations

from functools import partial

import anyio
from fastapi import APIRouter, Request, Response
from fastapi.responses import FileResponse

from impactd.api.client_keys import DIAGNOSIS, job_key
from impactd.api.diagnosis_schemas import diagnosis_answer
from impactd.api.problems import ProblemError
from impactd.api.recordings_schemas import (
    FileName,
    ReadingBody,
    RecordingsDiagnosisBody,
    SetName,
)
from impactd.api.schemas import Key
from impactd.api.security import Limits, TheCaller, TheDaemon
from impactd.daemon import Daemon
from impactd.jobs.recordings import RecordingSet
from impactd.storage.jobs import DIAGNOSE, Job
from impactd.storage.recording_files import RECORDINGS_NAME
from impactd.wire.recordings_answers import (
    ReadingAnswer,
    RecordedFile,
    RecordingsAnswer,
    RecordingsPage,
    StatedValues,
)
from impactd.wire.rig_answers import DiagnosisAnswer

router = APIRouter(prefix="/v1/recordings", tags=["recordings"])
_MOST_DIAGNOSES = 50
"""The newest of all that are looked through for those of a set."""
_BINARY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}
_PAUSE_S = 0.005
"""Between the parts (64 KiB and more) of all uploads: an abort goes round the same loop."""


@router.get("")
def list_recordings(daemon: TheDaemon) -> RecordingsPage:
    """List uploaded recordings, newest first, with their diagnoses."""
    jobs = daemon.archive.jobs.list(kind=DIAGNOSE, limit=_MOST_DIAGNOSES)
    return RecordingsPage(items=[_answer(daemon, one, jobs) for one in daemon.recordings.all()])


@router.get("/{name}")
def show_recordings(name: SetName, daemon: TheDaemon) -> RecordingsAnswer:
    """Show the files of a set, what was stated of them, and their diagnoses."""
    jobs = daemon.archive.jobs.list(kind=DIAGNOSE, limit=_MOST_DIAGNOSES)
    return _answer(daemon, daemon.recordings.get(name), jobs)


@router.delete("/{name}", status_code=204)
def delete_recordings(name: SetName, daemon: TheDaemon) -> None:
    """Delete recordings with what was made of them; their diagnoses stay, with their documents.

    The event of the request says who did it and when. Not while a diagnosis of them is under way.
    """
    daemon.recordings.delete(name)


@router.put("/{name}/files/{file}", openapi_extra=_BINARY)
async def upload_recording(
    name: SetName, file: FileName, request: Request, daemon: TheDaemon
) -> RecordedFile:
    """Upload a recording as it is, of up to 32 MiB.

    It is text (also gzip), npy, npz, wav, uff, tdms or lvm. The set begins with
    its first file. The same file may come again; nothing is overwritten.
    """
    content = await _body(request)
    await anyio.to_thread.run_sync(daemon.recordings.keep, name, file, content)
    return RecordedFile(name=file, size_bytes=len(content))


@router.put("/{name}/drops", openapi_extra=_BINARY)
async def state_drops(name: SetName, request: Request, daemon: TheDaemon) -> StatedValues:
    """State which drop was which by a table, as `impactd new --drops` reads it.

    Its columns are `name` (a file or a shot), `sphere`, `surface` and `drop_height_mm`.
    """
    content = await _body(request)
    return StatedValues(
        values=await anyio.to_thread.run_sync(daemon.recordings.keep_drops, name, content)
    )


async def _body(request: Request) -> bytes:
    """Return what is uploaded, taken in small parts."""
    limits: Limits = request.app.state.limits
    content = bytearray()
    async for part in request.stream():
        content += part
        async with limits.uploads:
            await anyio.sleep(_PAUSE_S)
    return bytes(content)


@router.post("/{name}/reading")
async def read_recordings(
    name: SetName, body: ReadingBody, request: Request, daemon: TheDaemon
) -> ReadingAnswer:
    """Read the files as `impactd new` does: hits, units, sampling, assumptions, what is missing."""
    limits: Limits = request.app.state.limits
    read = partial(daemon.recordings.read, name, body.choices(), body.values)
    found = await anyio.to_thread.run_sync(read, limiter=limits.apart)
    return ReadingAnswer(**found, links={"picture": f"/v1/recordings/{name}/picture.png"})


@router.get("/{name}/picture.png", response_class=FileResponse)
def show_picture(name: SetName, daemon: TheDaemon) -> FileResponse:
    """Show what the last reading found: the recordings above, each hit below."""
    picture = daemon.recordings.get(name).picture
    if not picture.is_file():
        raise ProblemError(
            "not-found",
            f"The recordings {name} have not been read.",
            remedy=f"Read them first: POST /v1/recordings/{name}/reading.",
        )
    return FileResponse(picture, media_type="image/png")


@router.post("/{name}/diagnoses", status_code=202)
async def diagnose_recordings(  # noqa: PLR0917 - the framework fills them by name
    name: SetName,
    body: RecordingsDiagnosisBody,
    request: Request,
    response: Response,
    daemon: TheDaemon,
    caller: TheCaller,
    key: Key = None,
) -> DiagnosisAnswer:
    """Fit the hits of recordings, and find out what the model misses; a campaign folder keeps them.

    Watch it as any diagnosis: `GET /v1/diagnoses/{id}`.
    """
    limits: Limits = request.app.state.limits
    ask = partial(
        daemon.recordings.request_diagnosis,
        name,
        body.choices(),
        body.values,
        base=body.base,
        budget_s=body.budget_s,
        key=job_key(caller, DIAGNOSIS, key),
    )
    job = await anyio.to_thread.run_sync(ask, limiter=limits.apart)
    response.headers["Location"] = f"/v1/diagnoses/{job.id}"
    return diagnosis_answer(job, daemon.jobs.progress(job.id))


def _answer(daemon: Daemon, found: RecordingSet, jobs: list[Job]) -> RecordingsAnswer:
    at = f"/v1/recordings/{found.name}"
    choices, values = found.stated()
    return RecordingsAnswer(
        name=found.name,
        files=[RecordedFile(name=one.name, size_bytes=one.stat().st_size) for one in found.files],
        choices=choices,
        values=values,
        diagnoses=[
            diagnosis_answer(job, daemon.jobs.progress(job.id), whole=False)
            for job in jobs
            if job.payload.get(RECORDINGS_NAME) == found.name
            # not of deleted recordings that had this name
            and (daemon.archive.directory / job.payload["campaign"]).exists()
        ],
        links={
            "self": at,
            "reading": f"{at}/reading",
            "picture": f"{at}/picture.png" if found.picture.is_file() else None,
            "diagnoses": f"{at}/diagnoses",
        },
    )
