"""The REST API from the command line's side."""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx2

from impactd.console.failure import Failure

DEFAULT_URL = "http://127.0.0.1:8642"
_POLL_S = 0.1


class Client:
    """A connection to one daemon.

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
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        # trust_env: a proxy of the environment must not see requests to loopback.
        self._http = httpx2.Client(
            base_url=self.url, headers=headers, timeout=timeout_s, trust_env=False
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._http.close()

    def get(self, path: str, **query: Any) -> dict[str, Any]:
        """Return the JSON of a resource; ``None`` values of the query are left out."""
        given = {name: value for name, value in query.items() if value is not None}
        return self._json("GET", path, params=given or None)

    def send(
        self, method: str, path: str, body: Any = None, *, key: str | None = None
    ) -> dict[str, Any]:
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

        Raises
        ------
        Failure
            With the problem's own sentence.
        """
        headers = {"Idempotency-Key": key} if key else None
        try:
            return self._json(method, path, json=body, headers=headers)
        except _LostError:
            if key is None:
                raise
            time.sleep(0.5)
            return self._json(method, path, json=body, headers=headers)

    def pages(self, path: str, limit: int, **query: Any) -> Iterator[dict[str, Any]]:
        """Yield up to ``limit`` items of a collection, page by page."""
        page = self.get(path, limit=min(limit, 200), **query)
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
        to.write_bytes(self._answer("GET", path).content)

    def wait(
        self,
        path: str,
        final: Callable[[dict[str, Any]], bool],
        tell: Callable[[str, float | None], None],
    ) -> dict[str, Any]:
        """Ask again until a resource has ended.

        Parameters
        ----------
        path : str
            The resource.
        final : callable
            Says whether an answer is the last one.
        tell : callable
            Is told the state and, where the daemon says so, the share that is done.

        Returns
        -------
        dict
            The last answer.
        """
        while True:
            answer = self.get(path)
            tell(*_how_far(answer))
            if final(answer):
                return answer
            time.sleep(_POLL_S)

    def _json(self, method: str, path: str, **arguments: Any) -> dict[str, Any]:
        answer = self._answer(method, path, **arguments)
        body: dict[str, Any] = answer.json()
        return body

    def _answer(self, method: str, path: str, **arguments: Any) -> httpx2.Response:
        try:
            answer = self._http.request(method, path, **arguments)
        except httpx2.ConnectError as error:
            raise Failure(
                f"no daemon answers at {self.url}; start one with `impactd serve`, or name it with "
                "--url or IMPACTD_URL."
            ) from error
        except httpx2.TimeoutException as error:
            raise _LostError(f"the daemon at {self.url} did not answer in time.") from error
        except (httpx2.TransportError, httpx2.InvalidURL) as error:
            raise _LostError(f"the connection to {self.url} failed: {error}.") from error
        if answer.is_success:
            return answer
        raise Failure(_said(answer))


def _how_far(answer: dict[str, Any]) -> tuple[str, float | None]:
    state, told = str(answer.get("state", "")), answer.get("progress")
    return (f"{state}, {told['text']}", float(told["share"])) if told else (state, None)


class _LostError(Failure):
    """Nobody knows whether the request arrived."""


def _said(answer: httpx2.Response) -> str:
    try:
        problem = answer.json()
    except ValueError:
        problem = {}
    if "detail" not in problem:
        return f"{answer.url} answered with HTTP {answer.status_code}; is that an impactd?"
    return f"{problem['detail']} {problem.get('remedy', '')}".strip()


def token_from_environment() -> str | None:
    """Return the token: IMPACTD_TOKEN, or the file that IMPACTD_TOKEN_FILE names.

    Returns
    -------
    str or None
        ``None`` when neither is set.

    Raises
    ------
    Failure
        If the file cannot be read.
    """
    token = os.environ.get("IMPACTD_TOKEN")
    file = os.environ.get("IMPACTD_TOKEN_FILE")
    if not token and file:
        try:
            token = Path(file).read_text(encoding="utf-8")
        except OSError as error:
            raise Failure(f"the token file {file} cannot be read: {error.strerror}.") from error
    return token.strip() if token else None


def connect(url: str | None) -> Client:
    """Return a client for an address and the token of the environment."""
    return Client(address(url), token_from_environment())


def address(url: str | None) -> str:
    """Return where the daemon is: as given, by the environment, or where it listens by default."""
    return url or os.environ.get("IMPACTD_URL") or DEFAULT_URL


def fresh_key() -> str:
    """Return a new idempotency key."""
    return str(uuid.uuid4())
