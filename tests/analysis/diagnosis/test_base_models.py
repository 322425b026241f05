"""Which base model a diagnosis starts from, and goes on with."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.diagnosing import diagnose
from analysis.diagnosis.base_choice import (
    base_beside_effect,
    effect_leads,
    fitted_base,
    mixed_base,
)
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.diagnosis.progress import Watch
from analysis.diagnosis.uncertain_numbers import with_uncertain_numbers
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
    assert mixed_base(fitted_base(whole, "kv2", Watch())[0].last) == base


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
    default, other = (fitted_base(whole, base, Watch()) for base in ("kv2", mixed))
    assert effect_leads(default, other, Watch()) == leads


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "seed", "base"),
    [("drawn", 42, "kv2-reaction"), ("drawn", 12, "kv2-coupon-force_end"), ("closed", 3, None)],
)
def test_an_effect_does_not_hide_which_laws_a_rig_obeys(
    tmp_path: Path, rig: str, seed: int, base: str | None
) -> None:
    """Beside a large hum no base stands out; with the hum fitted one does."""
    hum = make_effect("mains_hum", {"amplitude_v": 0.3, "frequency_hz": 50.0, "harmonics": 2.0})
    whole = campaign_with(tmp_path, (hum,), rig, seed)
    selection, usual = fitted_base(whole, "kv2", Watch())
    assert mixed_base(selection.last) is None
    found = base_beside_effect(whole, (with_uncertain_numbers(selection), usual), Watch())
    assert (found and found[0].last.problem.model.base_name) == base
