"""Sequences of requests to a daemon, independent of the transport.

A talk is a generator: it yields what is to be asked and gets the answer's JSON. `Connection` and
`AsyncConnection` carry the same talks, so that waiting, repeating and ending are written once.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from impactd.aliases import Json
from impactd.client.errors import EndedError, LostError, NotReadyError

Said = TypeVar("Said")
Tell = Callable[[str, float | None], None]
"""Is told what is being done and, where the daemon says so, the share that is done."""

POLL_S = 0.1
"""A shot is to be on the screen within 2 s of its bang; this is a twentieth of it."""
PAGE = 200
"""Items of a page, as many as the API gives."""
_AGAIN_AFTER_S = 0.5
_COMPARED_WITHIN_S = 5.0
"""A shot is held against its repetitions in a fraction of a second, the first one in a few."""
DROP_ENDED = ("analysed", "failed", "aborted", "interrupted")
_RUN_ENDED = ("done", "failed")
_JOB_ENDED = ("done", "failed", "cancelled")


@dataclass(frozen=True)
class Ask:
    """A request; ``key`` is the idempotency key."""

    method: str
    path: str
    query: Mapping[str, Any] | None = None
    body: Any = None
    key: str | None = None


@dataclass(frozen=True)
class Pause:
    """Nothing, for a while."""

    seconds: float


Talk = Generator[Ask | Pause, Json, Said]


def fresh_key() -> str:
    """Return a new idempotency key."""
    return str(uuid.uuid4())


def silent(text: str, share: float | None) -> None:
    """Report no progress."""


def get(path: str, **query: Any) -> Talk[Json]:
    """Return a resource; ``None`` values of the query are left out."""
    given = {name: value for name, value in query.items() if value is not None}
    return (yield Ask("GET", path, given or None))


def send(method: str, path: str, body: Any = None, *, key: str | None = None) -> Talk[Json]:
    """Return the answer to a body; with a key a lost connection is tried once more.

    Yields
    ------
    Ask or Pause
        The request, and once more after a pause.
    """
    ask = Ask(method, path, None, body, key)
    try:
        return (yield ask)
    except LostError:
        if key is None:
            raise
    yield Pause(_AGAIN_AFTER_S)
    return (yield ask)  # the same key: it cannot act twice


def wait(path: str, ended: Callable[[Json], bool], tell: Tell) -> Talk[Json]:
    """Return a resource once it has ended."""
    while True:
        answer = yield from get(path)
        tell(*_how_far(answer))
        if ended(answer):
            return answer
        yield Pause(POLL_S)


def wait_until_ready(limit_s: float) -> Talk[Json]:
    """Return the light once it is READY.

    Raises
    ------
    NotReadyError
        With the light's own sentence, when it is not within the limit.
    """
    ends_s = time.monotonic() + limit_s
    while True:
        status = yield from get("/v1/status")
        if status["ready"]:
            return status
        if time.monotonic() >= ends_s:
            raise NotReadyError(
                {"type": "urn:impactd:problem:not-ready", "status": 409}
                | {"detail": status["sentence"], "state": status["state"]}
            )
        yield Pause(POLL_S)


def drop_has_ended(drop: Json) -> bool:
    """Return whether nothing more comes of a drop."""
    # A stored drop with a problem could not be analysed.
    return drop["state"] in DROP_ENDED or (drop["state"] == "stored" and bool(drop["problem"]))


def watch_drop(number: int, tell: Tell) -> Talk[Json]:
    """Return a drop once nothing more comes of it."""
    return (yield from wait(f"/v1/drops/{number}", drop_has_ended, _named(f"drop {number}", tell)))


def compared_shot(number: int) -> Talk[Json]:
    """Return a shot once it was compared with its repetitions, or as it is after a time limit."""
    ends_s = time.monotonic() + _COMPARED_WITHIN_S
    while True:
        shot = yield from get(f"/v1/shots/{number}")
        if shot.get("repetitions", ...) is not None or time.monotonic() >= ends_s:
            return shot
        yield Pause(POLL_S)


def shot_of_drop(number: int, tell: Tell) -> Talk[Json]:
    """Return the shot of a drop that is under way or has ended.

    Raises
    ------
    EndedError
        When the drop ended without one.
    """
    drop = yield from watch_drop(number, tell)
    if drop["shot"] is None:
        raise EndedError(f"Drop {number}: {_why(drop)}", drop)
    return (yield from compared_shot(drop["shot"]))


def calibration_of(number: int, tell: Tell) -> Talk[Json]:
    """Return a calibration once it is done.

    Raises
    ------
    EndedError
        When it failed.
    """
    told = _named(f"calibration {number}", tell)
    run = yield from wait(
        f"/v1/calibrations/{number}", lambda answer: answer["state"] in _RUN_ENDED, told
    )
    if run["state"] == "failed":
        raise EndedError(f"Calibration {number}: {_why(run)}", run)
    return run


def job_result(path: str, name: str, tell: Tell) -> Talk[Json]:
    """Return a fit or a diagnosis once it is done.

    Raises
    ------
    EndedError
        When it failed or was cancelled.
    """
    job = yield from wait(path, lambda answer: answer["state"] in _JOB_ENDED, _named(name, tell))
    if job["state"] != "done":
        raise EndedError(f"The {name} is {job['state']}: {job['reason']}", job)
    return job


def abort_calibration(number: int) -> Talk[Json]:
    """End a calibration that still drops spheres; one that has ended stays as it is."""
    run = yield from get(f"/v1/calibrations/{number}")
    if run["state"] in ("requested", "running"):
        yield from send("POST", "/v1/abort")
    return run


def _how_far(answer: Json) -> tuple[str, float | None]:
    state, told = str(answer.get("state", "")), answer.get("progress")
    return (f"{state}, {told['text']}", float(told["share"])) if told else (state, None)


def _named(name: str, tell: Tell) -> Tell:
    return lambda text, share: tell(f"{name}: {text}", share)


def _why(answer: Json) -> str:
    problem = answer["problem"] or {"detail": f"it is {answer['state']}.", "remedy": ""}
    return f"{problem['detail']} {problem['remedy']}".strip()
