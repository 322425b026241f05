"""Moduli: what all shots together say about each material."""

from __future__ import annotations

import hashlib
import json
from functools import partial
from typing import Annotated, Any

import anyio
from fastapi import APIRouter, Query, Request, Response

from impactd.api.answers import moment
from impactd.api.finite import without_nan
from impactd.api.schemas import Moment
from impactd.api.security import TheDaemon
from impactd.moduli_service import ModuliAnswer

router = APIRouter(prefix="/v1/moduli", tags=["moduli"])
_Text = Annotated[str | None, Query(min_length=1, max_length=200)]


@router.get("", response_model=dict[str, Any])
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
        since=moment("since", since),
        until=moment("until", until),
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


def _encoded(answer: ModuliAnswer) -> bytes:
    head = json.dumps(
        without_nan(answer.head), ensure_ascii=False, allow_nan=False, separators=(",", ":")
    )
    lists = b",".join(b'"%s":%s' % (name.encode(), text) for name, text in answer.lists.items())
    return b"%s,%s}" % (head[:-1].encode(), lists)
