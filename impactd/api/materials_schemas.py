"""The body of a request to change a material."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from impactd.api.schemas import Request


class MaterialBody(Request):
    """A material as it is to be from now on."""

    entry: dict[str, Any] = Field(
        description="Complete, in the keys of the materials file: radius_m, mass_kg, batch, "
        "youngs_modulus_pa, poissons_ratio, reference, source; of a surface coupon_mass_kg and "
        "coupon_thickness_m.",
        max_length=32,
    )
    note: str = Field(default="", max_length=400, description="Why it is changed.")
