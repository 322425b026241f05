"""Sessions of the web page: a token or a code becomes a cookie that no script can read."""

from __future__ import annotations

import math

import anyio
from fastapi import APIRouter, Request, Response

from impactd.api.guess_limit import GuessLimit
from impactd.api.problems import ProblemError
from impactd.api.schemas import SignInBody
from impactd.api.security import (
    Caller,
    Limits,
    TheCaller,
    TheDaemon,
    address_of,
    note_failure,
)
from impactd.api.sessions import COOKIE, LIFE_S, Session, Sessions
from impactd.api.sign_in_codes import LIFE_S as CODE_LIFE_S
from impactd.api.sign_in_codes import SignInCodes
from impactd.storage.tokens import Token
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
    return _begin(request, response, token)


@router.post("/by-code", status_code=201)
async def log_in_by_code(
    request: Request, response: Response, daemon: TheDaemon, body: SignInBody
) -> SessionAnswer:
    """Turn a code of `POST /v1/sign-in-codes` into a session cookie; a code works once.

    The answer is that of `POST /v1/session`. After too many wrong codes it is 429 for the rest of
    a minute, whatever the code.
    """
    limits: Limits = request.app.state.limits
    number = await _token_of_code(request, body.code)
    token = await anyio.to_thread.run_sync(
        daemon.archive.tokens.valid, number, limiter=limits.token
    )
    if token is None:
        await note_failure(request, "code")
        raise ProblemError(
            "code-invalid",
            "The token behind the code has expired or was revoked.",
            headers={"WWW-Authenticate": 'Bearer error="invalid_token"'},
        )
    request.state.caller_name = token.name  # for the log of who asked for what
    return await anyio.to_thread.run_sync(_begin, request, response, token)


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


async def _token_of_code(request: Request, code: str) -> int:
    """Use up a code and return its token's number; refuse a wrong one, and one too many."""
    codes: SignInCodes = request.app.state.sign_in_codes
    guesses: GuessLimit = request.app.state.guess_limit
    address = address_of(request)
    wait_s = guesses.wait_s(address)
    number = codes.take(code) if wait_s <= 0 else None
    if number is not None:
        return number
    if wait_s > 0:
        await note_failure(request, "code")
        raise ProblemError(
            "too-many-guesses",
            f"Too many wrong sign-in codes arrived; none is read for {math.ceil(wait_s)} s.",
            remedy=f"Wait {math.ceil(wait_s)} s, or sign in with a token.",
            headers={"Retry-After": str(math.ceil(wait_s))},
        )
    guesses.note(address)
    await note_failure(request, "code")
    raise ProblemError(
        "code-invalid",
        "The code is mistyped, used, replaced by a newer one, or older than "
        f"{CODE_LIFE_S / 60:.0f} minutes.",
        headers={"WWW-Authenticate": 'Bearer error="invalid_token"'},
    )


def _begin(request: Request, response: Response, token: Token) -> SessionAnswer:
    """Begin a session of a token and hand its cookie over."""
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
    return SessionAnswer(name=token.name, scope=token.scope, csrf=session.csrf)


def _answer(caller: Caller, session: Session | None) -> SessionAnswer:
    scope = caller.scope.name.lower() if caller.scope else "read"
    return SessionAnswer(name=caller.name, scope=scope, csrf=session.csrf if session else None)
