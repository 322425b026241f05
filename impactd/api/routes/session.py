"""Sessions of the web page: a token shown once becomes a cookie that no script can read."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from impactd.api.problems import ProblemError
from impactd.api.security import Caller, TheCaller, TheDaemon
from impactd.api.sessions import COOKIE, LIFE_S, Session, Sessions
from impactd.wire.rig_answers import SessionAnswer

router = APIRouter(prefix="/v1/session", tags=["session"])


@router.post("", status_code=201)
def log_in(
    request: Request, response: Response, daemon: TheDaemon, caller: TheCaller
) -> SessionAnswer:
    """Turn the bearer token of this request into a session cookie.

    Everything that writes with the cookie must send the answer's `csrf` in `X-CSRF-Token`.
    """
    token = daemon.archive.tokens.valid(caller.token_id) if caller.token_id else None
    if token is None or caller.session is not None:
        raise ProblemError(
            "token-missing",
            "A session begins with a bearer token, not with a cookie.",
            headers={"WWW-Authenticate": 'Bearer realm="impactd"'},
        )
    sessions: Sessions = request.app.state.sessions
    session, secret = sessions.begin(token)
    response.set_cookie(
        COOKIE,
        secret,
        max_age=int(LIFE_S),
        path="/",
        httponly=True,
        samesite="strict",
        # Loopback speaks plain HTTP, where a browser would drop a Secure cookie.
        secure=request.url.scheme == "https",
    )
    return _answer(caller, session)


@router.get("")
def who_am_i(caller: TheCaller) -> SessionAnswer:
    """Say whose session or token this is; a page that was loaded again finds its `csrf` here."""
    return _answer(caller, caller.session)


@router.delete("", status_code=204)
def log_out(request: Request, response: Response, caller: TheCaller) -> None:
    """End the session of the cookie; a token stays valid until it is revoked."""
    sessions: Sessions = request.app.state.sessions
    if caller.session is not None:
        sessions.end(request.cookies.get(COOKIE, ""))
    response.delete_cookie(COOKIE, path="/", httponly=True, samesite="strict")


def _answer(caller: Caller, session: Session | None) -> SessionAnswer:
    scope = caller.scope.name.lower() if caller.scope else "read"
    return SessionAnswer(name=caller.name, scope=scope, csrf=session.csrf if session else None)
