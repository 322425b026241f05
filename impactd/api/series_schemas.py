"""The bodies of requests about a series of drops."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from impactd.api.schemas import DropBody, Request


class SeriesDrops(DropBody):
    """Some equal drops."""

    repeats: int = Field(default=1, ge=1, le=100)


class SeriesBody(Request):
    """What is to be dropped, in this order."""

    drops: list[SeriesDrops] = Field(min_length=1, max_length=100)
    note: str = Field(default="", max_length=400, description="What the series is for.")


class MoreDropsBody(Request):
    """Drops to add at the end."""

    drops: list[SeriesDrops] = Field(min_length=1, max_length=100)


class OrderBody(Request):
    """The planned drops in their new order; those left out are not made."""

    order: list[Annotated[int, Field(ge=1)]] = Field(max_length=500)
