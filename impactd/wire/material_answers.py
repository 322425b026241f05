"""What materials look like on the wire."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from impactd.wire.answers import Answer


class MaterialAnswer(Answer):
    """A material as drops and fits take it now."""

    role: str
    name: str
    entry: dict[str, Any]
    changed_utc: str | None = Field(description="Null where it is as the file has it.")
    changed_by: str | None
    changes: int


class MaterialChangeAnswer(Answer):
    """One change of one material."""

    version: int
    utc: str
    by: str
    role: str
    name: str
    before: dict[str, Any] | None
    after: dict[str, Any]
    note: str


class MaterialChangesAnswer(Answer):
    """Every change of one material, newest first."""

    items: list[MaterialChangeAnswer]


class MaterialsAnswer(Answer):
    """All materials, and their latest changes, newest first."""

    version: int = Field(description="How many changes there were; fits say theirs.")
    spheres: list[MaterialAnswer]
    surfaces: list[MaterialAnswer]
    changes: list[MaterialChangeAnswer]
    grades: list[str] = Field(description="Of balls, for `batch.grade`.")
