"""What was sealed beside what was found: one name for one number."""

from __future__ import annotations

from typing import Any

import pytest

from drivers.simulated.effects import LIBRARY
from impactd.demo.sealed_effects import ComparedEffect, compared_effects
from impactd.effect_list import effect_list

FORMS_ONLY = {
    ("amplifier_lowpass", "filter_order"),  # the library has a form for each order
    ("clipping", "softness"),  # only its soft forms have one
    ("coupon_mode", "mass_ratio"),  # over the crystal; the library's share counts the coupon too
    ("coupon_mode", "hit_scatter"),  # the library frees the mass in every shot
    *(("mains_hum", name) for name in ("amplitude_v", "frequency_hz", "harmonics")),
}
"""Numbers of the simulated rig that the library's effect of the same id does not have."""


def sealed(name: str, scope: dict[str, Any] | None = None, **numbers: float) -> dict[str, Any]:
    """Return what the simulated rig unseals."""
    effect = {"id": name, "slot": "contact", "parameters": numbers, "scope": scope or {}}
    return {"effects": [effect], "sensor": {"crystal_mass_kg": 0.03}}


def named(name: str, **numbers: float) -> dict[str, Any]:
    """Return what a diagnosis names."""
    parameters = {key: {"value": value, "u": 0.01, "unit": "1"} for key, value in numbers.items()}
    return {"id": name, "slot": "contact", "form": name, "acts_on": None, "parameters": parameters}


def cells(effect: ComparedEffect) -> dict[str, tuple[str, str]]:
    """Return what is sealed and what is found, by name."""
    return {name: (before, after) for name, before, after, _ in effect.rows}


BOTH_HAVE = [effect for effect in effect_list() if effect["id"] in LIBRARY]


@pytest.mark.parametrize("effect", BOTH_HAVE, ids=lambda effect: effect["id"])
def test_every_sealed_number_has_the_library_s_name(effect: dict[str, Any]) -> None:
    """But for those that the library does not have at all."""
    kind = LIBRARY[effect["id"]]
    numbers = {parameter.name: 0.5 for parameter in kind.parameters}
    (shown,) = compared_effects(sealed(kind.id, **numbers), [])
    own = {name for at, name in FORMS_ONLY if at == kind.id}
    library = {parameter["name"] for parameter in effect["parameters"]}
    assert set(cells(shown)) - {"slot", "acts on", "form"} - own <= library


def test_a_number_stands_beside_what_was_found_of_it() -> None:
    """Also where rig and library call it differently, and where a material has its own."""
    (echo,) = compared_effects(sealed("echo", ratio=0.02), [named("echo", strength=0.03)])
    assert cells(echo)["strength"] == ("0.02", "0.030 ± 0.020")
    assert echo.remark == ""
    (mode,) = compared_effects(
        sealed("coupon_mode", {"surface": "ptfe"}, damping_ratio=0.02),
        [named("coupon_mode", **{"damping_ratio[ptfe]": 0.03})],
    )
    assert cells(mode)["damping_ratio"] == ("0.02", "0.030 ± 0.020 [ptfe]")
    assert cells(mode)["acts on"] == ("surface ptfe", "everything")


def test_a_mass_is_told_as_the_ratio_that_a_trace_shows() -> None:
    """The library gives the stand's mass as the crystal's over it."""
    (stand,) = compared_effects(sealed("base_compliance", base_mass_kg=3.0), [])
    assert cells(stand)["crystal_over_base_mass"] == ("0.01", "-")


def test_what_was_missed_and_what_is_false_is_said() -> None:
    """Each effect of either side has its rows, and a remark where the other side lacks it."""
    missed, false = compared_effects(sealed("x_sphere_spin", size=1.0), [named("echo")])
    assert (missed.id, missed.remark) == (
        "x_sphere_spin",
        "not named; the library does not have it",
    )
    assert (false.id, false.remark) == ("echo", "named, and does not act")
    assert cells(false)["slot"] == ("-", "contact")
