"""What materials look like on the wire."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from impactd.api.schemas import Answer, Request


class MaterialBody(Request):
    """A material as it is to be from now on."""

    entry: dict[str, Any] = Field(
        description="Complete, in the keys of the materials file: radius_m, mass_kg, batch, "
        "youngs_modulus_pa, poissons_ratio, reference, source; of a surface coupon_mass_kg and "
        "coupon_thickness_m.",
        max_length=32,
    )
    note: str = Field(default="", max_length=400, description="Why it is changed.")


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


class MaterialsAnswer(Answer):
    """All materials, and their latest changes, newest first."""

    version: int = Field(description="How many changes there were; fits say theirs.")
    spheres: list[MaterialAnswer]
    surfaces: list[MaterialAnswer]
    changes: list[MaterialChangeAnswer]
    grades: list[str] = Field(description="Of balls, for `batch.grade`.")
