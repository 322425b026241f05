"""Shots: lists, one, its file and its trace."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import FileResponse

from impactd.api.answers import next_page, shot_answer, shot_summary, timestamp
from impactd.api.decimate import MAX_POINTS, min_max_indices
from impactd.api.problems import ProblemError
from impactd.api.schemas import Before, Limit, Moment, Number
from impactd.api.security import TheDaemon
from impactd.jobs.curves import samples_of
from impactd.storage.exchange import csv_text
from impactd.storage.shot_metadata import QUANTITIES
from impactd.wire.answers import CurveAnswer, CurvesAnswer, ShotAnswer, ShotPage, TraceAnswer

router = APIRouter(prefix="/v1/shots", tags=["shots"])
# No record lasts longer, and a moment far outside must not overflow the count of samples.
_LONGEST_S = 1e6
_TraceTime = Annotated[
    float | None,
    Query(
        allow_inf_nan=False,
        ge=-_LONGEST_S,
        le=_LONGEST_S,
        description="First or last moment, from the trigger. [s]",
    ),
]
_Filter = Annotated[str | None, Query(min_length=1, max_length=64)]


@router.get("")
def list_shots(  # noqa: PLR0917 - the framework fills them by name
    daemon: TheDaemon,
    sphere: _Filter = None,
    surface: _Filter = None,
    since: Moment = None,
    until: Moment = None,
    search: Annotated[
        str | None,
        Query(
            min_length=1,
            max_length=64,
            description="A number, or a part of sphere, surface, operator or origin.",
        ),
    ] = None,
    summary: Annotated[
        bool, Query(description="With advice and reduced modulus; takes a look at every fit.")
    ] = False,
    limit: Limit = 50,
    before: Before = None,
) -> ShotPage:
    """List shots, newest first, by pair, time and words."""
    shots = daemon.archive.shots(
        sphere=sphere,
        surface=surface,
        since=timestamp("since", since),
        until=timestamp("until", until),
        search=search,
        limit=limit,
        before=before,
    )
    query = {"sphere": sphere, "surface": surface, "since": since, "until": until}
    query |= {"search": search, "summary": "true" if summary else None}
    fits, compared = daemon.archive.fits, daemon.archive.comparisons
    return ShotPage(
        items=[
            shot_summary(shot, fits.for_shot(shot.number), compared.get(shot.number))
            if summary
            else shot_answer(shot)
            for shot in shots
        ],
        next=next_page("/v1/shots", [shot.number for shot in shots], limit, query),
    )


_FILE: dict[int | str, dict[str, Any]] = {200: {"content": {"application/x-hdf5": {}}}}


@router.get("/{number}.h5", response_class=FileResponse, responses=_FILE)
@router.head("/{number}.h5", response_class=FileResponse, responses=_FILE)
def download(number: Number, request: Request, daemon: TheDaemon) -> Response:
    """Download a shot's NeXus HDF5 file; `ETag` is its SHA-256, `Range` is honoured."""
    shot = daemon.archive.shot(number)
    path = daemon.archive.shot_path(number)
    _check(path, shot.sha256, number)
    headers = {
        "ETag": f'"{shot.sha256}"',
        "Cache-Control": "private, no-cache, immutable",
    }
    known = [tag.strip().removeprefix("W/") for tag in _if_none_match(request).split(",")]
    if headers["ETag"] in known or "*" in known:
        return Response(status_code=304, headers=headers)
    return FileResponse(
        path, media_type="application/x-hdf5", filename=f"shot-{number:06d}.h5", headers=headers
    )


_CSV: dict[int | str, dict[str, Any]] = {200: {"content": {"text/csv": {}}}}


@router.get("/{number}.csv", response_class=Response, responses=_CSV)
def download_csv(number: Number, daemon: TheDaemon) -> Response:
    """Download a shot's samples as text: time from the trigger, and the signal in its unit."""
    name = f"shot-{number:06d}.csv"
    return Response(
        csv_text(daemon.archive.read_shot(number)),
        media_type="text/csv; charset=utf-8",
        headers={"Content-Disposition": f'attachment; filename="{name}"'},
    )


def _check(path: Path, sha256: str, number: int) -> None:
    """Refuse a file that is damaged."""
    if not path.is_file():
        raise ProblemError("damaged", f"The file of shot {number} is missing.")
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    if found != sha256:
        raise ProblemError(
            "damaged",
            f"The file of shot {number} has the SHA-256 {found}; {sha256} was stored.",
        )


def _if_none_match(request: Request) -> str:
    return request.headers.get("if-none-match", "")


@router.get("/{number}")
def show_shot(number: Number, daemon: TheDaemon) -> ShotAnswer:
    """Show a shot with its latest fits, and whether to use, check or repeat it."""
    archive = daemon.archive
    shot = archive.shot(number)
    return shot_answer(shot, archive.fits.for_shot(number), archive.comparisons.get(number))


@router.get("/{number}/trace")
def trace(
    number: Number,
    daemon: TheDaemon,
    points: Annotated[int, Query(ge=2, le=MAX_POINTS)] = 2000,
    start_s: _TraceTime = None,
    stop_s: _TraceTime = None,
) -> TraceAnswer:
    """Return a shot's signal for drawing; time is 0 at the trigger."""
    recording = daemon.archive.read_shot(number).recording
    signal, rate_hz = recording.signal, recording.sample_rate_hz
    trigger = recording.trigger_index
    first = 0 if start_s is None else round(start_s * rate_hz) + trigger
    last = signal.size if stop_s is None else round(stop_s * rate_hz) + trigger + 1
    first, last = max(first, 0), min(last, signal.size)
    if first >= last:
        raise ProblemError(
            "invalid",
            f"Shot {number} has no samples between {start_s} s and {stop_s} s; it lasts from "
            f"{-trigger / rate_hz:g} s to {(signal.size - 1 - trigger) / rate_hz:g} s.",
        )
    part = signal[first:last]
    kept = min_max_indices(part, points)
    return TraceAnswer(
        number=number,
        quantity=recording.quantity,
        unit=QUANTITIES[recording.quantity],
        start_s=(first - trigger) / rate_hz,
        stop_s=(last - 1 - trigger) / rate_hz,
        samples=int(part.size),
        decimated=bool(kept.size < part.size),
        time_s=((kept + first - trigger) / rate_hz).tolist(),
        signal=part[kept].tolist(),
    )


@router.get("/{number}/curves")
def curves(number: Number, daemon: TheDaemon) -> CurvesAnswer:
    """Return the models' curves of a shot, for drawing; time is 0 at the trigger."""
    shot = daemon.archive.shot(number)
    fits = daemon.archive.fits.for_shot(number)
    kept = [fit for fit in fits if "curve" in fit.result]
    return CurvesAnswer(
        number=number,
        unit=QUANTITIES[shot.quantity],
        items=[
            CurveAnswer(
                fit=fit.id,
                model=fit.model,
                start_s=(fit.result["curve"]["first"] - shot.trigger_index) / shot.sample_rate_hz,
                interval_s=1.0 / shot.sample_rate_hz,
                signal=samples_of(fit.result["curve"]).tolist(),
            )
            for fit in kept
        ],
        missing=[fit.model for fit in fits if fit not in kept],
    )
