"""A connection to one daemon, for programs with an event loop."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import anyio
import httpx2

from impactd.aliases import Json
from impactd.client import talk
from impactd.client.answering import checked, client_options, lost_lines_named, request_options
from impactd.client.errors import LostError, RigError, UnreachableError
from impactd.client.events import Event, Position
from impactd.client.talk import Ask, Pause, Said, Talk


class AsyncConnection:
    """A connection to one daemon; answers are its JSON.

    Parameters
    ----------
    url : str
        Its address.
    token : str, optional
        A bearer token.
    timeout_s : float, optional
        Longest wait for one answer. [s]
    """

    def __init__(self, url: str, token: str | None = None, *, timeout_s: float = 30.0) -> None:
        self.url = url.rstrip("/")
        self.timeout_s = timeout_s
        self._http = httpx2.AsyncClient(**client_options(self.url, token, timeout_s))

    async def close(self) -> None:
        """Close it."""
        await self._http.aclose()

    async def run(self, said: Talk[Said]) -> Said:
        """Carry a talk to its end and return what came of it."""
        step = next(said)
        try:
            while True:
                try:
                    answer = await self._do(step)
                except RigError as error:
                    step = said.throw(error)
                else:
                    step = said.send(answer)
        except StopIteration as ended:
            result: Said = ended.value
            return result

    async def pages(self, path: str, limit: int, **query: Any) -> AsyncIterator[Json]:
        """Yield up to ``limit`` items of a collection, page by page."""
        page = await self.run(talk.get(path, limit=min(limit, talk.PAGE), **query))
        left = limit
        while True:
            for item in page["items"][:left]:
                yield item
                left -= 1
            if left <= 0 or not page.get("next"):
                return
            page = await self.run(talk.get(page["next"]))

    async def events(self, after: int | None = None) -> AsyncIterator[Event]:
        """Yield events as they come; a lost line is taken up again where it broke.

        Parameters
        ----------
        after : int, optional
            Number of the last event that was seen; without it, from the next one on.

        Yields
        ------
        Event
            In the order of their numbers, none twice, none left out.

        Raises
        ------
        UnreachableError
            If no daemon answers at first; later it waits for the daemon's return.
        """
        position = Position(after)
        while True:
            try:
                with lost_lines_named(self.url):
                    async with self._http.stream(**position.options(self.timeout_s)) as answer:
                        if not answer.is_success:
                            await answer.aread()
                        position.begin(checked(answer))
                        async for frame in httpx2.EventSource(answer):
                            event = position.take(frame)
                            if event is not None:
                                yield event
            except (LostError, UnreachableError):
                if not position.connected:
                    raise
            await anyio.sleep(position.again_after_s)

    async def newest_event(self) -> int:
        """Return the number of the newest event, 0 before the first."""
        position = Position(None)
        with lost_lines_named(self.url):
            async with self._http.stream(**position.options(self.timeout_s)) as answer:
                if not answer.is_success:
                    await answer.aread()
                position.begin(checked(answer))
        assert position.last is not None, "a stream says where it begins"
        return position.last

    async def _do(self, step: Ask | Pause) -> Json:
        if isinstance(step, Pause):
            await anyio.sleep(step.seconds)
            return {}
        with lost_lines_named(self.url):
            answer = await self._http.request(**request_options(step))
        found: Json = checked(answer).json()
        return found
