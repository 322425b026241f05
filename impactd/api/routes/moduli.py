"""Moduli: what all shots together say about each material, and how certain that is."""

# ruff: noqa: PLC0415 - imported when first asked for: the rig must not wait for the fits to load

from __future__ import annotations

import hashlib
import json
from functools import partial
from typing import Annotated, Any, Literal

import anyio
from fastapi import APIRouter, Query, Request, Response

from impactd.api.answers import timestamp
from impactd.api.finite import without_nan
from impactd.api.problems import ProblemError
from impactd.api.schemas import Moment
from impactd.api.security import TheDaemon
from impactd.moduli.service import ModuliAnswer
from impactd.wire.model_answers import ModuliDocument

router = APIRouter(prefix="/v1/moduli", tags=["moduli"])
_Text = Annotated[str | None, Query(min_length=1, max_length=200)]
_LowerLimit = Annotated[float | None, Query(alias="lower_Pa", description="[Pa]")]
_UpperLimit = Annotated[float | None, Query(alias="upper_Pa", description="[Pa]")]


@router.get("", response_model=ModuliDocument)
async def moduli(  # noqa: PLR0917 - the framework fills them by name
    request: Request,
    daemon: TheDaemon,
    specimen: _Text = None,
    since: Moment = None,
    until: Moment = None,
    model: _Text = None,
) -> Response:
    """Return the fitted moduli with their uncertainties, by material.

    `model` is the active one unless it is given; `since` and `until` choose shots by their time.
    With the `ETag` of an answer in `If-None-Match`, an unchanged one is 304 without a body.
    """
    ask = partial(
        daemon.moduli,
        specimen=specimen,
        since=timestamp("since", since),
        until=timestamp("until", until),
        model=model,
    )

    def encoded() -> tuple[bytes, str]:
        """Return body and tag."""
        body = _encoded(ask())
        return body, f'"{hashlib.blake2b(body, digest_size=16).hexdigest()}"'

    body, tag = await anyio.to_thread.run_sync(encoded)
    headers = {"ETag": tag, "Cache-Control": "private, no-cache"}
    if tag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return Response(body, media_type="application/json", headers=headers)


@router.get("/budget", response_model=dict[str, Any])
async def budget(  # noqa: PLR0917 - the framework fills them by name
    daemon: TheDaemon,
    specimen: _Text = None,
    since: Moment = None,
    until: Moment = None,
    model: _Text = None,
    lower_pa: _LowerLimit = None,
    upper_pa: _UpperLimit = None,
    rule: Annotated[Literal["both", "acceptance", "rejection", "simple"], Query()] = "both",
    guard_factor: Annotated[float, Query(ge=0, le=10)] = 1.0,
    modulus: Annotated[
        Literal["youngs_modulus_Pa", "plane_strain_modulus_Pa"], Query()
    ] = "youngs_modulus_Pa",
) -> Response:
    """Return what the uncertainty of every modulus is made of, and what would improve it most.

    The first four parameters are those of `GET /moduli`. With `lower_Pa` or `upper_Pa` the
    specimen's `modulus` gets a decision under `conformity`: its probability to lie within the
    limits, and `pass`, `fail` or `undecided` by the `rule`, with a guard band of `guard_factor`
    times the expanded uncertainty (JCGM 106).
    """
    limited = lower_pa is not None or upper_pa is not None
    if limited and specimen is None:
        raise ProblemError(
            "invalid",
            "A limit was given without a specimen.",
            remedy="Add `specimen` with the name of the limit's surface.",
        )
    ask = partial(
        daemon.moduli_budget,
        specimen=specimen,
        since=timestamp("since", since),
        until=timestamp("until", until),
        model=model,
    )

    def encoded() -> bytes:
        """Return the body."""
        from analysis.conformity import Limits, decide

        limits = Limits(lower_pa, upper_pa, rule, guard_factor) if limited else None
        found = ask()
        if limits is not None:
            # a name that is a sphere's too has another key
            decide(found, next(iter(found["moduli"]), str(specimen)), modulus, limits)
        return json.dumps(without_nan(found), ensure_ascii=False, allow_nan=False).encode()

    return Response(await anyio.to_thread.run_sync(encoded), media_type="application/json")


def _encoded(answer: ModuliAnswer) -> bytes:
    head = json.dumps(
        without_nan(answer.head), ensure_ascii=False, allow_nan=False, separators=(",", ":")
    )
    lists = b",".join(b'"%s":%s' % (name.encode(), text) for name, text in answer.lists.items())
    return b"%s,%s}" % (head[:-1].encode(), lists)
