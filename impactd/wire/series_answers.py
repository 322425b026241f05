"""What a series of drops looks like on the wire."""

from __future__ import annotations

from pydantic import Field

from impactd.wire.answers import Answer


class PlannedDropAnswer(Answer):
    """One drop of a series."""

    id: int = Field(description="Of its place in the plan, from 1; stays when it is reordered.")
    sphere: str
    surface: str
    drop_height_m: float
    operator: str
    state: str = Field(description="planned, under way, done or failed.")
    drop: int | None


class SeriesAnswer(Answer):
    """The series that runs, or ran last since the daemon began."""

    state: str = Field(description="none, running, paused or ended.")
    reason: str = Field(description="Why it is paused or ended.")
    owner: str | None
    note: str
    done: int
    of: int
    remaining_s: float | None
    drops: list[PlannedDropAnswer]
