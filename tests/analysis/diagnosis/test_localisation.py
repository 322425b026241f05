"""Slots are told by what generic families explain."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from analysis.diagnosis.discrepancy.choice import BEYOND_FIRST_ORDER
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.localisation import (
    BANK,
    FAMILIES,
    SHARES,
    UNLISTED,
    formula,
    gains_by_family,
    locate,
    probabilities,
)
from analysis.diagnosis.progress import TimeBudget, Watch
from analysis.diagnosis.selection import Step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.effects import make_effect

from .conftest import campaign_with


@pytest.fixture(scope="module")
def gains(leaky):
    """What the bank says of a campaign through a leaky coupler."""
    first = leaky.steps[0]
    return gains_by_family(linearise(first.problem, first.fitted, wanted=FAMILIES))


def test_probabilities_are_of_five_slots_and_sum_to_one(gains):
    """Whatever the gains, one of the slots it is."""
    found = probabilities(gains, 1e4, 4)
    assert sorted(found) == ["contact", "electronics", "mounting", "release", "sensor"]
    assert math.isclose(sum(found.values()), 1.0)
    assert min(found.values()) >= 0.0


def test_every_family_but_the_generic_one_is_the_work_of_some_slot():
    """``locked`` follows anything that is in step with the impact."""
    asked = {family for family, _ in (*BANK, *BEYOND_FIRST_ORDER)}
    assert asked - set(SHARES) == {"locked"}
    assert set(SHARES) <= asked
    assert all(max(shares) > 0.0 for shares in SHARES.values())


def test_the_work_of_one_slot_speaks_for_it_and_a_shared_one_for_both():
    """Speeds that contradict heights are the release's; a curve may be crystal or converter."""
    speed = {("locked", "rig"): 9e4, ("speed", "shot"): 8e4, ("curve", "rig"): 1e3}
    assert probabilities(speed, 9e4, 9)["release"] > 0.95
    curve = probabilities({("speed", "shot"): 1e3, ("curve", "rig"): 9e4}, 9e4, 9)
    assert curve["sensor"] == curve["electronics"] > 0.45


def test_where_nothing_explains_much_no_slot_is_likely():
    """A family that explains a hundredth is no answer, even where the others explain less."""
    found = probabilities(dict.fromkeys(BANK, 0.0) | {("contact", "rig"): 900.0}, 9e4, 9)
    assert max(found.values()) < 0.3
    assert set(probabilities({}, 9e4, 9).values()) == {0.2}


def test_even_a_family_that_explains_all_leaves_room_for_what_no_family_describes():
    """The other slots keep their part of it."""
    found = probabilities({("speed", "shot"): 9e4, ("curve", "rig"): 1e3}, 9e4, 30)
    assert found["mounting"] == pytest.approx(UNLISTED / 5)
    assert found["release"] == pytest.approx(1.0 - UNLISTED * 4 / 5)


@pytest.mark.parametrize("pieces", [1, 5])
def test_what_explains_alike_is_as_likely(pieces):
    """Shares of 59, 60 and 63 % of one misfit's squares are no reason to choose."""
    alike = {("contact", "rig"): 0.59e4, ("droop", "rig"): 0.60e4, ("seat", "surface"): 0.63e4}
    found = probabilities(alike, 1e4, pieces)
    contact, mounting = (found[slot] - UNLISTED / 5 for slot in ("contact", "mounting"))
    assert contact / mounting == pytest.approx((0.39 / 0.43) ** (0.5 * pieces), rel=0.01)


def test_what_differs_from_coupon_to_coupon_is_rather_the_mount():
    """The crystal does not know what lies on it, but may ring otherwise in every shot."""
    by_coupon = probabilities({("pitch", "surface"): 9e4}, 9e4, 9)
    by_shot = probabilities({("pitch", "shot"): 9e4}, 9e4, 9)
    assert by_coupon["mounting"] > by_coupon["sensor"]
    assert by_shot["sensor"] > by_shot["mounting"]


def test_many_misfits_make_one_slot_sure_and_overflow_nothing():
    """Three hundred of one family that leaves a hundredth, another that leaves a half."""
    gains = {("contact", "rig"): 0.99e6, ("droop", "rig"): 0.5e6}
    found = probabilities(gains, 1e6, 300)
    assert found["contact"] == pytest.approx(1.0 - UNLISTED * 4 / 5)
    assert sum(found.values()) == pytest.approx(1.0)
    assert all(p >= 0.0 for p in found.values())


def test_a_leaky_coupler_is_located_in_the_electronics(leaky):
    """Or in the sensor, whose charge may creep as well: no other slot is as likely."""
    located = locate(leaky.steps[0], lambda stage, share: None)
    assert set(located.also) | {located.slot} >= {"electronics", "sensor"}
    assert located.probabilities["electronics"] == max(located.probabilities.values())
    assert abs(sum(located.probabilities.values()) - 1.0) < 1e-12


@pytest.mark.parametrize("seconds", [1.0, 300.0])
def test_of_many_shots_a_place_is_told_whenever_the_time_is_over(
    tmp_path: Path, seconds: float
) -> None:
    """Discrepancies are chosen on some shots; that the time is over is no error there either."""
    leaks = make_effect("coupler_highpass", {"time_constant_s": 5e-3})
    problem, nuisances = with_start(
        build(campaign_with(tmp_path, (leaks,), repeats=3), model_named("kv2"))
    )
    fitted = joint.fit(problem, nuisances)
    over = Watch(budget=TimeBudget(seconds, iter(range(10**6)).__next__)).over(problem)
    located = locate(Step(over, fitted), lambda stage, share: None)
    assert {located.slot, *located.also} & {"electronics", "sensor"}


def test_a_short_formula_holds_on_held_out_shots(leaky):
    """One slow decay, of those that the family offers, does nearly all of a high-pass."""
    linearised = leaky.steps[0].linearised
    found = formula(linearised, linearised.explain("memory", "rig"))
    assert found
    assert all("decay" in label or "lag" in label for label, _ in found)
