"""A connection to one daemon, for programs that wait."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx2

from impactd.aliases import Json
from impactd.client import talk
from impactd.client.answering import checked, client_options, lost_lines_named, request_options
from impactd.client.errors import LostError, RigError, UnreachableError
from impactd.client.events import Event, Position
from impactd.client.talk import Ask, Pause, Said, Talk


class Connection:
    """A connection to one daemon; answers are its JSON.

    Parameters
    ----------
    url : str
        Its address.
    token : str, optional
        A bearer token; without it only ``status`` answers, and only on the same machine.
    timeout_s : float, optional
        Longest wait for one answer. [s]
    """

    def __init__(self, url: str, token: str | None = None, *, timeout_s: float = 30.0) -> None:
        self.url = url.rstrip("/")
        self.timeout_s = timeout_s
        self._http = httpx2.Client(**client_options(self.url, token, timeout_s))

    def __enter__(self) -> Connection:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close it."""
        self._http.close()

    def run(self, said: Talk[Said]) -> Said:
        """Carry a talk to its end and return what came of it."""
        step = next(said)
        try:
            while True:
                try:
                    answer = self._do(step)
                except RigError as error:
                    step = said.throw(error)
                else:
                    step = said.send(answer)
        except StopIteration as ended:
            result: Said = ended.value
            return result

    def get(self, path: str, **query: Any) -> Json:
        """Return the JSON of a resource; ``None`` values of the query are left out."""
        return self.run(talk.get(path, **query))

    def send(self, method: str, path: str, body: Any = None, *, key: str | None = None) -> Json:
        """Send a body and return the JSON of the answer.

        Parameters
        ----------
        method : str
            HTTP method.
        path : str
            The resource.
        body : object, optional
            JSON-ready.
        key : str, optional
            Idempotency key. With one, a lost connection is tried once more: it cannot act twice.

        Returns
        -------
        dict
            The answer.
        """
        return self.run(talk.send(method, path, body, key=key))

    def wait(self, path: str, final: Callable[[Json], bool], tell: talk.Tell) -> Json:
        """Return a resource once it has ended; ``tell`` hears how far it is."""
        return self.run(talk.wait(path, final, tell))

    def pages(self, path: str, limit: int, **query: Any) -> Iterator[Json]:
        """Yield up to ``limit`` items of a collection, page by page."""
        page = self.get(path, limit=min(limit, talk.PAGE), **query)
        left = limit
        while True:
            for item in page["items"][:left]:
                yield item
                left -= 1
            if left <= 0 or not page.get("next"):
                return
            page = self.get(page["next"])

    def download(self, path: str, to: Path) -> None:
        """Write a resource's bytes to a file."""
        to.write_bytes(self._answer({"method": "GET", "url": path}).content)

    def part(self, path: str, first: int, last: int, tag: str | None) -> httpx2.Response:
        """Return bytes ``first`` to ``last`` of a resource, whole when its tag has changed."""
        headers = {"Range": f"bytes={first}-{last}"} | ({"If-Range": tag} if tag else {})
        return self._answer({"method": "GET", "url": path, "headers": headers})

    def events(self, after: int | None = None) -> Iterator[Event]:
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
                with (
                    lost_lines_named(self.url),
                    self._http.stream(**position.options(self.timeout_s)) as answer,
                ):
                    if not answer.is_success:
                        answer.read()
                    position.begin(checked(answer))
                    for frame in httpx2.EventSource(answer):
                        event = position.take(frame)
                        if event is not None:
                            yield event
            except (LostError, UnreachableError):
                if not position.connected:
                    raise
            time.sleep(position.again_after_s)

    def _do(self, step: Ask | Pause) -> Json:
        if isinstance(step, Pause):
            time.sleep(step.seconds)
            return {}
        answer: Json = self._answer(request_options(step)).json()
        return answer

    def _answer(self, options: dict[str, Any]) -> httpx2.Response:
        with lost_lines_named(self.url):
            answer = self._http.request(**options)
        return checked(answer)
