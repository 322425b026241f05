"""Moduli: what all shots together say about each material."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query

from impactd.api.answers import moment
from impactd.api.finite import without_nan
from impactd.api.schemas import Moment
from impactd.api.security import TheDaemon

router = APIRouter(prefix="/v1/moduli", tags=["moduli"])
_Text = Annotated[str | None, Query(min_length=1, max_length=200)]


@router.get("")
def moduli(
    daemon: TheDaemon,
    specimen: _Text = None,
    since: Moment = None,
    until: Moment = None,
    model: _Text = None,
) -> dict[str, Any]:
    """Return the fitted moduli with their uncertainties, by material.

    `model` is the active one unless it is given; `since` and `until` choose shots by their time.
    """
    found: dict[str, Any] = without_nan(
        daemon.moduli(
            specimen=specimen,
            since=moment("since", since),
            until=moment("until", until),
            model=model,
        )
    )
    return found
