"""Status, abort and acknowledgement: the rig as a person sees it."""

from __future__ import annotations

import time

import anyio
from fastapi import APIRouter, Request

from impactd.api.answers import plain
from impactd.api.arrivals import Arrivals
from impactd.api.own_commands import SIGN_UP, as_typed_here
from impactd.api.security import Limits, TheCaller, TheDaemon, is_local
from impactd.guides.files import manual_is_built
from impactd.wire.rig_answers import AbortAnswer, StatusAnswer

router = APIRouter(prefix="/v1", tags=["rig"])


@router.get("/status")
async def status(request: Request, daemon: TheDaemon) -> StatusAnswer:
    """Say READY or NOT READY in one sentence, why, and what to do."""
    # One change of threads only, and none that waits behind lists and downloads.
    limits: Limits = request.app.state.limits
    found = await anyio.to_thread.run_sync(daemon.status, limiter=limits.status)
    here = as_typed_here(SIGN_UP, daemon.own_options).strip("`")
    found["manual"] = manual_is_built()
    return StatusAnswer(**plain(found), token_command=here if is_local(request) else None)


@router.post("/abort")
async def abort(request: Request, daemon: TheDaemon, caller: TheCaller) -> AbortAnswer:
    """Abort whatever runs, at once; never queued behind other requests."""
    limits: Limits = request.app.state.limits
    arrivals: Arrivals = request.app.state.arrivals
    received_s: float = getattr(request.state, "received_s", time.monotonic())
    arrivals.begin()
    try:
        began_s, report = await anyio.to_thread.run_sync(
            lambda: (time.monotonic(), daemon.service.abort(by=caller.name)), limiter=limits.abort
        )
    finally:
        await arrivals.settle()
    return AbortAnswer(
        aborted=report.aborted,
        drop=report.drop,
        sentence=report.sentence,
        took_s=report.took_s,
        took_ms=1e3 * (began_s - received_s + report.took_s),
        safe_after_ms=1e3 * (time.monotonic() - received_s),
    )


@router.post("/acknowledge")
def acknowledge(daemon: TheDaemon, caller: TheCaller) -> StatusAnswer:
    """Say that the rig was checked after a fault; without it the rig stays NOT READY."""
    daemon.service.acknowledge_fault(by=caller.name)
    return StatusAnswer(**plain(daemon.status()))
