"""Sign-in codes: a terminal that has a token makes one, and a browser uses it."""

from __future__ import annotations

from fastapi import APIRouter, Request

from impactd.api.problems import ProblemError
from impactd.api.security import TheCaller
from impactd.api.sign_in_codes import LIFE_S, SignInCodes
from impactd.wire.rig_answers import SignInCodeAnswer

router = APIRouter(prefix="/v1/sign-in-codes", tags=["session"])


@router.post("", status_code=201)
def make_code(request: Request, caller: TheCaller) -> SignInCodeAnswer:
    """Make a code that signs one browser in, once, with the rights of this request's token.

    It ends the token's last code. It takes no `Idempotency-Key`: nothing moves, and only the hash
    of a code is kept, so that no repetition can be answered with the same code.
    """
    if caller.token_id is None or caller.scope is None or caller.session is not None:
        # With a cookie's code, a stolen cookie could be made to live for ever.
        raise ProblemError(
            "token-missing",
            "A sign-in code is made with a bearer token, not with a cookie.",
            headers={"WWW-Authenticate": 'Bearer realm="impactd"'},
        )
    codes: SignInCodes = request.app.state.sign_in_codes
    return SignInCodeAnswer(
        code=codes.make(caller.token_id),
        life_s=LIFE_S,
        name=caller.name,
        scope=caller.scope.name.lower(),
    )
