"""Sending a request and reading an answer: shared by both connections."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import httpx2

from impactd.client.errors import LostError, RigError, UnreachableError, problem_of
from impactd.client.talk import Ask


def client_options(url: str, token: str | None, timeout_s: float) -> dict[str, Any]:
    """Return what an HTTP client of either kind is made with.

    Parameters
    ----------
    url : str
        The daemon's address.
    token : str or None
        Bearer token.
    timeout_s : float
        Longest wait for one answer. [s]

    Returns
    -------
    dict
        Keyword arguments.
    """
    return {
        "base_url": url,
        "headers": {"Authorization": f"Bearer {token}"} if token else {},
        "timeout": timeout_s,
        # a proxy of the environment must not see requests to loopback
        "trust_env": False,
    }


def request_options(ask: Ask) -> dict[str, Any]:
    """Return a request as keyword arguments of an HTTP client."""
    return {
        "method": ask.method,
        "url": ask.path,
        "params": dict(ask.query) if ask.query else None,
        "json": ask.body,
        "headers": {"Idempotency-Key": ask.key} if ask.key else None,
    }


@contextmanager
def lost_lines_named(url: str) -> Iterator[None]:
    """Raise what happens to a connection as one of our errors.

    Raises
    ------
    UnreachableError
        Nothing arrived.
    LostError
        Something may have.
    """
    try:
        yield
    except (httpx2.ConnectError, httpx2.ConnectTimeout, httpx2.UnsupportedProtocol) as error:
        raise UnreachableError(
            f"no daemon answers at {url}; wait if it is only starting, start one with `impactd "
            "serve`, or give its address with --url or IMPACTD_URL."
        ) from error
    except httpx2.TimeoutException as error:
        raise LostError(f"the daemon at {url} did not answer in time.") from error
    except (httpx2.TransportError, httpx2.InvalidURL) as error:
        raise LostError(f"the connection to {url} failed: {error}.") from error


def checked(answer: httpx2.Response) -> httpx2.Response:
    """Return an answer that was read, if it is a success.

    Raises
    ------
    ProblemError
        With the daemon's own words.
    RigError
        If what answers is no daemon of ours.
    """
    if answer.is_success:
        return answer
    try:
        problem = answer.json()
    except ValueError:
        problem = None
    if not isinstance(problem, dict) or not {"type", "detail"} <= problem.keys():
        raise RigError(
            f"{answer.url} answered with HTTP {answer.status_code}; check that the address is "
            "that of an impactd daemon."
        )
    raise problem_of(problem)
