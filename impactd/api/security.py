"""Authorisation: one table of every route and the scope it needs.

A caller is known by a bearer token, or by the cookie of a session that was begun with one (see
`impactd.api.sessions`). A token is an opaque random string, stored hashed, with one of three
scopes. A larger scope holds the smaller ones: ``read`` < ``operate`` < ``admin``. A route that is
missing in `ROUTE_SCOPES` is refused to everybody, so that forgetting one is noticed and never open.
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, TypeVar

import anyio
from fastapi import Depends, Request, Security
from fastapi.security import APIKeyCookie, HTTPAuthorizationCredentials, HTTPBearer

from impactd.api.failed_logins import FailedLogins
from impactd.api.problems import ProblemError
from impactd.api.sessions import COOKIE, CSRF_HEADER, Session, Sessions, csrf_holds
from impactd.api.token_memory import TokenMemory
from impactd.daemon import Daemon
from impactd.storage.tokens import Token


class Scope(IntEnum):
    """What a token allows."""

    READ = 1
    OPERATE = 2
    ADMIN = 3


Asked = TypeVar("Asked", str, int)
PUBLIC = "public"
"""Anybody who reaches the port."""
LOOPBACK = "loopback"
"""Anybody on this machine; from elsewhere a token with scope ``read``."""

ROUTE_SCOPES: dict[tuple[str, str], Scope | str] = {
    ("POST", "/v1/drops"): Scope.OPERATE,
    ("GET", "/v1/drops"): Scope.READ,
    ("GET", "/v1/drops/{number}"): Scope.READ,
    ("PATCH", "/v1/drops/{number}"): Scope.OPERATE,
    ("DELETE", "/v1/drops/{number}"): Scope.OPERATE,
    ("POST", "/v1/series"): Scope.OPERATE,
    ("GET", "/v1/series"): Scope.READ,
    ("DELETE", "/v1/series"): Scope.OPERATE,
    ("POST", "/v1/series/drops"): Scope.OPERATE,
    ("PUT", "/v1/series/order"): Scope.OPERATE,
    ("POST", "/v1/series/pause"): Scope.OPERATE,
    ("POST", "/v1/series/resume"): Scope.OPERATE,
    ("GET", "/v1/shots"): Scope.READ,
    ("GET", "/v1/shots/{number}"): Scope.READ,
    ("GET", "/v1/shots/{number}.h5"): Scope.READ,
    ("HEAD", "/v1/shots/{number}.h5"): Scope.READ,
    ("GET", "/v1/shots/{number}.csv"): Scope.READ,
    ("GET", "/v1/shots/{number}/trace"): Scope.READ,
    ("GET", "/v1/shots/{number}/curves"): Scope.READ,
    ("POST", "/v1/fits"): Scope.OPERATE,
    ("GET", "/v1/fits/{fit_id}"): Scope.READ,
    ("GET", "/v1/moduli"): Scope.READ,
    ("GET", "/v1/moduli/budget"): Scope.READ,
    ("GET", "/v1/results"): Scope.READ,
    ("GET", "/v1/results/chart"): Scope.READ,
    ("GET", "/v1/results/export"): Scope.READ,
    ("GET", "/v1/results/report.html"): Scope.READ,
    ("POST", "/v1/calibrations"): Scope.OPERATE,
    ("GET", "/v1/calibrations"): Scope.READ,
    ("GET", "/v1/calibrations/current"): Scope.READ,
    ("GET", "/v1/calibrations/{calibration_id}"): Scope.READ,
    ("POST", "/v1/diagnoses"): Scope.OPERATE,
    ("GET", "/v1/diagnoses"): Scope.READ,
    ("GET", "/v1/diagnoses/{diagnosis_id}"): Scope.READ,
    ("DELETE", "/v1/diagnoses/{diagnosis_id}"): Scope.OPERATE,
    ("POST", "/v1/diagnoses/{diagnosis_id}/next-drop"): Scope.OPERATE,
    ("GET", "/v1/diagnoses/{diagnosis_id}/report.html"): Scope.READ,
    ("GET", "/v1/diagnoses/{diagnosis_id}/report.pdf"): Scope.READ,
    ("GET", "/v1/recordings"): Scope.READ,
    ("GET", "/v1/recordings/{name}"): Scope.READ,
    ("PUT", "/v1/recordings/{name}/files/{file}"): Scope.OPERATE,
    ("PUT", "/v1/recordings/{name}/drops"): Scope.OPERATE,
    ("DELETE", "/v1/recordings/{name}"): Scope.OPERATE,
    ("POST", "/v1/recordings/{name}/reading"): Scope.OPERATE,
    ("GET", "/v1/recordings/{name}/picture.png"): Scope.READ,
    ("POST", "/v1/recordings/{name}/diagnoses"): Scope.OPERATE,
    ("GET", "/v1/effects"): Scope.READ,
    ("GET", "/v1/models"): Scope.READ,
    ("PUT", "/v1/models/active"): Scope.ADMIN,
    ("GET", "/v1/status"): LOOPBACK,
    ("GET", "/v1/rig"): Scope.READ,
    ("GET", "/v1/rig/health"): Scope.READ,
    ("GET", "/v1/materials"): Scope.READ,
    ("GET", "/v1/materials/{kind}/{name}"): Scope.READ,
    ("GET", "/v1/materials/{kind}/{name}/changes"): Scope.READ,
    ("PUT", "/v1/materials/{kind}/{name}"): Scope.OPERATE,
    ("GET", "/v1/alarms"): Scope.READ,
    ("POST", "/v1/alarms/{number}/acknowledge"): Scope.OPERATE,
    ("GET", "/v1/log"): Scope.READ,
    ("POST", "/v1/abort"): Scope.OPERATE,
    ("POST", "/v1/acknowledge"): Scope.OPERATE,
    ("GET", "/v1/events"): Scope.READ,
    ("POST", "/v1/session"): Scope.READ,
    ("GET", "/v1/session"): Scope.READ,
    ("DELETE", "/v1/session"): Scope.READ,
    ("POST", "/v1/session/by-code"): PUBLIC,  # the code is the proof, and its route reads it
    ("POST", "/v1/sign-in-codes"): Scope.READ,
    ("GET", "/healthz"): PUBLIC,
    ("GET", "/readyz"): PUBLIC,
    ("GET", "/metrics"): LOOPBACK,
    ("GET", "/openapi.json"): PUBLIC,
    ("GET", "/"): PUBLIC,
    ("GET", "/docs"): PUBLIC,
    ("GET", "/page/{folder}/{name}"): PUBLIC,
    ("GET", "/guides"): PUBLIC,
    ("GET", "/guides/{name:path}"): PUBLIC,
}

_PATTERNS = {
    path: re.compile(re.sub(r"\{\w+\}", "[^/]+", path.replace("{name:path}", ".*")))
    for _, path in ROUTE_SCOPES
}


def methods_of(path: str) -> list[str]:
    """Return the methods that a path knows, in alphabetical order.

    Where several templates match, the most literal one counts.
    """
    matching = [template for template, found in _PATTERNS.items() if found.fullmatch(path)]
    # Both /v1/shots/{number} and /v1/shots/{number}.h5 match a file: the longer one is meant.
    best = max(matching, key=lambda template: (-template.count("{"), len(template)), default="")
    found = {method for method, template in ROUTE_SCOPES if template == best}
    return sorted(found | ({"HEAD"} if "GET" in found else set()))


ABORT_ROUTES = frozenset({("POST", "/v1/abort"), ("DELETE", "/v1/drops/{number}")})


@dataclass(frozen=True)
class Caller:
    """Who is asking."""

    name: str
    """The token's name, or ``"anonymous"``."""
    scope: Scope | None
    """``None`` without a token."""
    token_id: int | None = None
    """Of the token itself, or of the one behind the session."""
    session: Session | None = None
    """Of the cookie, where the caller was known by one."""


class Limits:
    """Threads for abort and status, which never wait for slow downloads or full queues.

    Processes that are started for one request run one at a time (``apart``), and all uploads
    together advance by one part at a time (``uploads``).
    """

    def __init__(self) -> None:
        self.status = anyio.CapacityLimiter(4)
        self.abort = anyio.CapacityLimiter(8)
        self.abort_token = anyio.CapacityLimiter(8)
        self.abort_answer = anyio.CapacityLimiter(8)
        self.token = anyio.CapacityLimiter(8)
        self.apart = anyio.CapacityLimiter(1)
        self.uploads = anyio.CapacityLimiter(1)


_SAFE_METHODS = frozenset({"GET", "HEAD", "OPTIONS"})
_bearer = HTTPBearer(auto_error=False, description="A token of `impactd token create`.")
_cookie = APIKeyCookie(
    name=COOKIE,
    auto_error=False,
    description=f"Of `POST /v1/session`; writes also need the header `{CSRF_HEADER}`.",
)


async def the_daemon(request: Request) -> Daemon:
    """Return the daemon of this application."""
    daemon: Daemon = request.app.state.daemon
    return daemon


async def authorize(
    request: Request,
    credentials: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)],
    cookie: Annotated[str | None, Security(_cookie)],
) -> Caller:
    """Return a caller who may do this, or refuse.

    The matched route is looked up in `ROUTE_SCOPES`. A bearer token counts before a cookie.

    Raises
    ------
    ProblemError
        401 without a valid token or session where one is needed, 403 when its scope is too small,
        a write with a cookie lacks its second secret, or the route is missing in the table.
    """
    route = (request.method, request.scope["route"].path)
    needed = ROUTE_SCOPES.get(route)
    if needed is None:
        raise ProblemError("scope-too-small", f"{route[0]} {route[1]} is open to nobody.")
    if needed == PUBLIC or (needed == LOOPBACK and credentials is None and is_local(request)):
        return Caller("anonymous", None)
    scope = needed if isinstance(needed, Scope) else Scope.READ
    urgent = route in ABORT_ROUTES
    if credentials is None and cookie is not None:
        caller = await _caller_of_cookie(request, cookie, urgent=urgent)
    else:
        caller = await _caller(request, credentials, urgent=urgent)
    request.state.caller_name = caller.name  # for the log of who asked for what, refused or not
    if caller.scope is None or caller.scope < scope:
        held = caller.scope.name.lower() if caller.scope else "no"
        name = scope.name.lower()
        raise ProblemError(
            "scope-too-small",
            f"The token {caller.name!r} has {held} scope; this needs {name}.",
            headers={"WWW-Authenticate": f'Bearer error="insufficient_scope", scope="{name}"'},
            scope=name,
        )
    return caller


async def _caller(
    request: Request, credentials: HTTPAuthorizationCredentials | None, *, urgent: bool
) -> Caller:
    if credentials is None:
        raise ProblemError(
            "token-missing",
            "The request carries no bearer token.",
            headers={"WWW-Authenticate": 'Bearer realm="impactd"'},
        )
    memory: TokenMemory = request.app.state.token_memory
    token = await _look_up(
        request, memory.check if urgent else memory.ask, credentials.credentials, urgent=urgent
    )
    if token is None:
        await note_failure(request, "token", urgent=urgent)
        raise ProblemError(
            "token-invalid",
            "The token is unknown, expired or revoked.",
            headers={"WWW-Authenticate": 'Bearer error="invalid_token"'},
        )
    return Caller(token.name, Scope[token.scope.upper()], token.id)


async def _caller_of_cookie(request: Request, cookie: str, *, urgent: bool) -> Caller:
    daemon: Daemon = request.app.state.daemon
    memory: TokenMemory = request.app.state.token_memory
    sessions: Sessions = request.app.state.sessions
    session = sessions.find(cookie)
    token: Token | None = None
    if session is not None:
        # Asked each time, so that revoking a token ends its sessions, too.
        valid = memory.valid if urgent else daemon.archive.tokens.valid
        token = await _look_up(request, valid, session.token_id, urgent=urgent)
    if session is None or token is None:
        await note_failure(request, "session", urgent=urgent)
        raise ProblemError(
            "token-invalid",
            "The session is unknown or over, or its token was revoked.",
            remedy="Log in again with a token of `impactd token create`.",
            headers={"WWW-Authenticate": 'Bearer error="invalid_token"'},
        )
    if request.method not in _SAFE_METHODS and not csrf_holds(
        session, request.headers.get(CSRF_HEADER)
    ):
        raise ProblemError("csrf", f"A write with a cookie lacks its header {CSRF_HEADER}.")
    return Caller(token.name, Scope[token.scope.upper()], token.id, session)


async def _look_up(
    request: Request, look_up: Callable[[Asked], Token | None], asked: Asked, *, urgent: bool
) -> Token | None:
    """Check the token in memory or the database in a thread; aborts have their own threads."""
    limits: Limits = request.app.state.limits
    limiter = limits.abort_token if urgent else limits.token
    return await anyio.to_thread.run_sync(look_up, asked, limiter=limiter)


async def note_failure(request: Request, what: str, *, urgent: bool = False) -> None:
    """Log a refusal, and let it wait where there were many; an abort's never waits."""
    failed: FailedLogins = request.app.state.failed_logins
    delay_s = failed.note(address_of(request), what, request.url.path)
    if not urgent:
        await failed.slow_down(delay_s)


def address_of(request: Request) -> str:
    """Return where a request comes from, ``"unknown"`` where nobody can say."""
    return request.client.host if request.client else "unknown"


def is_local(request: Request) -> bool:
    """Tell whether a request comes from this computer."""
    if request.client is None:
        return False
    try:
        return ipaddress.ip_address(request.client.host).is_loopback
    except ValueError:
        return False


TheDaemon = Annotated[Daemon, Depends(the_daemon)]
TheCaller = Annotated[Caller, Depends(authorize)]
