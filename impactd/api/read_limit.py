"""Large answers have few threads: they compute long, and an abort must not wait for its turn."""

from __future__ import annotations

from collections.abc import AsyncIterator

import anyio
from fastapi import Depends, Request

# Each thread that computes may hold the interpreter for one switch interval (0.5 ms) before an
# abort's thread gets it; two keep both cores of a small machine busy.
_THREADS = 2
LARGE_READS = frozenset(
    {
        "/v1/moduli",
        "/v1/calibrations",
        "/v1/shots/{number}.h5",
        "/v1/shots/{number}.csv",
        "/v1/shots/{number}/trace",
        "/v1/shots/{number}/curves",
    }
)
"""Routes whose `GET` reads whole files or many fits; a list of shots does with `summary` only."""


class ReadLimit:
    """So many large answers are made at a time; the others wait their turn."""

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
        yield


# "function": the turn ends when the answer is made, not when a slow client has read it.
in_turn = Depends(_in_turn, scope="function")
"""A dependency of the whole application."""
