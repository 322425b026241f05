"""Drops: asking for one, watching it, aborting it."""

from __future__ import annotations

from dataclasses import replace

import anyio
from fastapi import APIRouter, Request, Response

from analysis.bounce import restitution_from_rebound_height
from analysis.campaign import Environment, Quantity
from impactd.api.answers import drop_answer, next_page
from impactd.api.arrivals import Accepted, Arrivals
from impactd.api.client_keys import drop_key
from impactd.api.environment_schema import EnvironmentBody
from impactd.api.problems import ProblemError
from impactd.api.schemas import Before, DropBody, Key, Limit, Number, ReboundBody
from impactd.api.security import Caller, Limits, TheCaller, TheDaemon
from impactd.daemon import Daemon
from impactd.jobs.orders import request_fit, shot_models
from impactd.storage.drops import Drop, DropRequest
from impactd.storage.errors import ArchiveError, NotFoundError
from impactd.wire.answers import DropAnswer, DropPage

router = APIRouter(prefix="/v1/drops", tags=["drops"])
# A row is read in a millisecond; a person does not notice a tenth of a second.
_ROW_PATIENCE_S = 0.1


def required_key(key: str | None, what: str) -> str:
    """Return the idempotency key of the header; raise ProblemError 400 when there is none.

    ``what`` says what would happen twice without it.
    """
    if not key:
        raise ProblemError(
            "idempotency-key-missing",
            f"A repeated request without an Idempotency-Key could {what} twice.",
        )
    return key


def owner_name(operator: str, caller: Caller) -> str:
    """Return a drop's owner as others see it: the person, and whose token was used."""
    return operator if operator == caller.name else f"{operator} ({caller.name})"


@router.post("", status_code=202)
def request_drop(  # noqa: PLR0917 - the framework fills them by name
    body: DropBody,
    response: Response,
    daemon: TheDaemon,
    caller: TheCaller,
    accepted: Accepted,
    key: Key = None,
) -> DropAnswer:
    """Ask for a drop.

    202 and a `Location` as soon as the request is durable; the drop goes on by itself. The same
    key and body again give the same drop. 409 names who holds the rig.
    """
    asked = DropRequest(
        body.sphere,
        body.surface,
        body.drop_height_m,
        body.operator,
        environment_of(body.environment),
    )
    return begin_drop(asked, response, daemon, caller, key, accepted)


def environment_of(body: EnvironmentBody | None) -> Environment | None:
    """Return what a request says of temperature and humidity."""
    return None if body is None else body.environment()


def begin_drop(  # noqa: PLR0917 - what a request brings, as the routes have it
    asked: DropRequest,
    response: Response,
    daemon: Daemon,
    caller: Caller,
    key: str | None,
    accepted: int,
) -> DropAnswer:
    """Begin a drop, or return the one of the same key; ``response`` gets the ``Location``.

    An abort since the epoch ``accepted``, at which the request arrived, refuses it. Raises
    ProblemError 400 without a key.
    """
    drop = daemon.service.request_drop(
        asked,
        owner=owner_name(asked.operator, caller),
        idempotency_key=drop_key(caller, required_key(key, "drop a sphere")),
        accepted=accepted,
    )
    response.headers["Location"] = f"/v1/drops/{drop.number}"
    return drop_answer(drop)


@router.get("")
def list_drops(daemon: TheDaemon, limit: Limit = 50, before: Before = None) -> DropPage:
    """List drops, newest first."""
    drops = daemon.archive.drops(limit=limit, before=before)
    numbers = [drop.number for drop in drops]
    return DropPage(
        items=[drop_answer(drop) for drop in drops], next=next_page("/v1/drops", numbers, limit, {})
    )


@router.get("/{number}")
def show_drop(number: Number, daemon: TheDaemon) -> DropAnswer:
    """Show a drop: `stored` once its shot is safe on the disk, `analysed` once it is fitted."""
    return drop_answer(daemon.archive.drop(number))


@router.patch("/{number}")
def enter_rebound(number: Number, body: ReboundBody, daemon: TheDaemon) -> DropAnswer:
    """Enter how high the sphere came back; its shot is fitted again with that.

    The flight to the second landing is sharper and counts first where the record holds it; the
    height is then checked against it (`rebound_height_disagrees`).
    """
    drop = daemon.archive.drop(number)
    restitution_from_rebound_height(
        Quantity(body.rebound_height_m, body.u_rebound_height_m), drop.request.drop_height_m
    )  # refuses what no sphere does
    drop = daemon.archive.set_rebound_height(number, body.rebound_height_m, body.u_rebound_height_m)
    if drop.shot is not None:
        for model in shot_models(daemon.archive):
            request_fit(daemon.archive, [drop.shot], model)
    return drop_answer(drop)


@router.delete("/{number}")
async def abort_drop(
    number: Number, request: Request, daemon: TheDaemon, caller: TheCaller
) -> DropAnswer:
    """Abort a drop that is under way; 409 when it has ended."""
    arrivals: Arrivals = request.app.state.arrivals
    limits: Limits = request.app.state.limits
    arrivals.begin()
    try:
        before, report = await anyio.to_thread.run_sync(
            lambda: (
                daemon.service.drop_under_way,
                daemon.service.abort(by=caller.name, number=number),
            ),
            limiter=limits.abort,
        )
    except BaseException:
        arrivals.cancel()
        raise
    if report.aborted:
        await arrivals.settle()
    else:
        arrivals.cancel()
    drop = await _read_in_time(daemon, number, limits)
    if report.aborted:
        if drop is None and before is not None and before.number == number:
            drop = replace(before, state="aborted")
        if drop is not None:
            return drop_answer(drop)
        raise ProblemError("storage", f"Drop {number} is aborted; its row cannot be read now.")
    is_what = f"is {drop.state}" if drop else "is not under way"
    raise ProblemError(
        "conflict",
        f"Drop {number} {is_what}; only a drop under way can be aborted.",
        state=drop.state if drop else None,
    )


async def _read_in_time(daemon: Daemon, number: int, limits: Limits) -> Drop | None:
    """Return a drop's row, ``None`` where the disk answers later than an abort may wait."""
    with anyio.move_on_after(_ROW_PATIENCE_S):
        try:
            return await anyio.to_thread.run_sync(
                daemon.archive.drop,
                number,
                limiter=limits.abort_answer,
                abandon_on_cancel=True,
            )
        except NotFoundError:
            raise
        except ArchiveError:
            return None
    return None
