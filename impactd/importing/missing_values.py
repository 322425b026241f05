"""What a modulus needs of a campaign and nobody has stated yet."""

from __future__ import annotations

from collections.abc import Sequence

from analysis.campaign import Campaign
from impactd.importing.new_campaign import few

_RATIO = ("poissons_ratio", "Poisson's ratio")
_BODY = (("radius_m", "radius"), ("mass_kg", "mass"), _RATIO)
_COUPON = (("coupon_mass_kg", "mass"), _RATIO)
_CELL = (
    ("compliance_m_per_v", "compliance"),
    ("crystal_mass_kg", "crystal mass"),
    ("crystal_stiffness_n_per_m", "crystal stiffness"),
    ("crystal_damping_n_s_per_m", "crystal damping"),
)


def missing_values(campaign: Campaign) -> list[str]:
    """Return what is missing, a line each; without it moduli are withheld or less certain."""
    shots = campaign.shots
    lines = [
        *_of_shots("sphere", [one.name for one in shots if one.sphere is None]),
        *(
            line
            for name, sphere in campaign.spheres.items()
            for line in _of(f"Sphere {name}", sphere, _BODY)
        ),
        *_of_shots("coupon", [one.name for one in shots if one.surface is None]),
        *(
            line
            for name, surface in campaign.surfaces.items()
            for line in _of(f"Coupon {name}", surface, _COUPON)
        ),
        *_of_shots(
            "drop height",
            [
                one.name
                for one in shots
                if one.drop_height_m is None and one.impact_speed_m_per_s is None
            ],
        ),
    ]
    if any(one.quantity == "voltage" for one in shots):
        lines += _of("Load cell", campaign.sensor, _CELL)
    return lines


def _of_shots(what: str, names: Sequence[str]) -> list[str]:
    return [f"{few(names)}: {what}."] if names else []


def _of(who: str, holder: object, members: Sequence[tuple[str, str]]) -> list[str]:
    absent = [word for key, word in members if getattr(holder, key) is None]
    return [f"{who}: {', '.join(absent)}."] if absent else []
