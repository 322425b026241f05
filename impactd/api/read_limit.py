"""A limit on large answers, two at a time with a pause, so that an abort need not wait.

An abort changes threads and goes round the event loop a dozen times. Each time it waits for
whoever computes or writes just then; the pause lets it in between readers that never stop.
"""

from __future__ import annotations

import time
from collections.abc import AsyncIterator

import anyio
from fastapi import Depends, Request

LARGE_READS = frozenset(
    {
        "/v1/moduli",
        "/v1/moduli/budget",
        "/v1/results",
        "/v1/results/chart",
        "/v1/results/export",
        "/v1/results/report.html",
        "/v1/diagnoses/{diagnosis_id}/report.html",
        "/v1/calibrations",
        "/v1/shots/{number}.h5",
        "/v1/shots/{number}.csv",
        "/v1/shots/{number}/trace",
        "/v1/shots/{number}/curves",
    }
)
"""Routes whose `GET` reads whole files or many fits; a list of shots does with `summary` only."""


_THREADS = 2
_LONGEST_PAUSE_S = 0.02
"""As long as the answer took, but no longer than an abort takes: a slow download is no flood."""


class ReadLimit:
    """Makes so many large answers at a time; the others wait their turn."""

    def __init__(self) -> None:
        self.threads = anyio.CapacityLimiter(_THREADS)


async def _in_turn(request: Request) -> AsyncIterator[None]:
    path = request.scope["route"].path
    summary = path == "/v1/shots" and "summary" in request.query_params
    if request.method not in {"GET", "HEAD"} or not (summary or path in LARGE_READS):
        yield
        return
    limit: ReadLimit = request.app.state.read_limit
    async with limit.threads:
        began_s = time.monotonic()
        yield
        await anyio.sleep(min(time.monotonic() - began_s, _LONGEST_PAUSE_S))


# "function": the turn ends when the answer is made, not when a slow client has read it.
in_turn = Depends(_in_turn, scope="function")
"""A dependency of the whole application."""
