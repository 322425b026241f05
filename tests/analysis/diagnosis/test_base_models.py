"""Which base model a diagnosis starts from, and goes on with."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.diagnosing import diagnose
from analysis.diagnosis.procedure import (
    _base,
    _effect_leads,
    _mixed_base,
    diagnose_campaign,
)
from analysis.diagnosis.progress import Watch
from drivers.simulated.effects import make_effect

from .conftest import campaign_with, small_campaign


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
def test_the_base_that_a_rig_obeys_is_found_from_hsd(tmp_path: Path, rig: str, base: str) -> None:
    """Nothing but the crystal is named, and the model that stands is the rig's own."""
    found = diagnose_campaign(small_campaign(tmp_path, rig=rig), "hsd")
    assert (found.verdict, found.effect_ids) == ("identified", ["crystal_dynamics"])
    assert found.steps[-1].problem.model.base == base


@pytest.mark.parametrize(("rig", "base"), [("closed", "kv2"), ("paper", "kv")])
def test_without_a_base_the_one_is_taken_that_a_rig_obeys(
    tmp_path: Path, rig: str, base: str
) -> None:
    """A clean rig is adequate under its own base, which is named where it is not the default."""
    document = diagnose(small_campaign(tmp_path, rig=rig))
    assert (document["verdict"], document["before"]["model"]) == ("adequate", base)
    assert ("obey kv rather than" in document["sentence"]) == (base == "kv")


@pytest.mark.parametrize(
    ("seed", "base"),
    [(12, "kv2-coupon-force_end"), (42, "kv2-reaction"), (76, "kv2-reaction-force_end")],
)
def test_the_laws_that_a_drawn_rig_leaves_out_are_found(
    tmp_path: Path, seed: int, base: str
) -> None:
    """A clean rig is adequate under a base between the paper's and the closed one, and says so."""
    document = diagnose(campaign_with(tmp_path, (), "drawn", seed))
    assert (document["verdict"], document["before"]["model"]) == ("adequate", base)
    assert f"obey {base} rather than" in document["sentence"]


@pytest.mark.parametrize(
    ("seed", "base"),
    [
        (14, "kv2-coupon"),
        (39, "kv2-coupon"),
        (6, "kv2-force_end"),
        (4, None),
        (2, None),
        (13, None),
    ],
)
def test_another_law_of_loss_does_not_hide_what_else_is_left_out(
    tmp_path: Path, seed: int, base: str | None
) -> None:
    """Rigs with Hunt and Crossley's loss, or Kuwabara and Kono's; the last three obey all laws.

    Hunt and Crossley's force ends with the indentation: where a contact ends makes no difference.
    """
    whole = campaign_with(tmp_path, (), "drawn", seed)
    assert _mixed_base(_base(whole, "kv2", Watch())[0].last) == base


@pytest.mark.slow
def test_a_coupon_that_is_stated_ten_times_too_light_is_no_other_base(tmp_path: Path) -> None:
    """It seems not to ride on the crystal; its mass explains all on the base that the rig obeys."""
    whole = campaign_with(tmp_path, (), "closed", 3)
    coupon = whole.surfaces["aluminium"]
    light = dataclasses.replace(coupon, coupon_mass_kg=0.1 * coupon.coupon_mass_kg)
    found = diagnose_campaign(
        dataclasses.replace(whole, surfaces={**whole.surfaces, "aluminium": light})
    )
    assert found.steps[0].problem.model.base_name == "kv2"
    (mistake,) = found.mistakes
    assert (mistake.id, mistake.name) == ("wrong_mass", "aluminium")
    mass, u, _ = mistake.parameters["coupon_mass_kg"]
    assert abs(mass - coupon.coupon_mass_kg) < 3.0 * u


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "seed", "mixed", "leads"),
    [("closed", 3, "kv2-reaction", True), ("drawn", 42, "kv2-reaction", False)],
    ids=["a closed rig", "a rig without that law"],
)
def test_an_effect_on_the_closed_base_is_held_against_a_mixed_one(
    tmp_path: Path, rig: str, seed: int, mixed: str, leads: bool
) -> None:
    """Beside the same coupler, the base that the rig obeys has more evidence."""
    coupler = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    whole = campaign_with(tmp_path, (coupler,), rig, seed)
    default, other = (_base(whole, base, Watch()) for base in ("kv2", mixed))
    assert _effect_leads(default, other, Watch()) == leads
