"""Effects whose law is published in several forms."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy import signal

from drivers.simulated.draw import draw_effect
from drivers.simulated.effects import EFFECTS, make_effect
from drivers.simulated.effects.stress_relaxation import arms
from drivers.simulated.filters import bessel, butterworth, rc_sections

if TYPE_CHECKING:
    from tests.drivers.simulated.conftest import Lab

FORMS = [(name, form) for name, kind in EFFECTS.items() for form in kind.forms if form]


@pytest.mark.parametrize(("effect_id", "form"), FORMS)
def test_every_form_is_the_base_model_at_the_neutral_value(
    lab: Lab, effect_id: str, form: str
) -> None:
    """As the first form is."""
    base, _ = lab.drop(lab.a_rig())
    effect = make_effect(effect_id, EFFECTS[effect_id].neutral_values(), form=form)
    same, _ = lab.drop(lab.a_rig(effect))
    np.testing.assert_allclose(same, base, atol=2e-6 * np.max(base))


@pytest.mark.parametrize(("effect_id", "form"), FORMS)
def test_every_form_does_something_of_its_own(lab: Lab, effect_id: str, form: str) -> None:
    """The record is finite and differs from that of every other form with the same values."""
    values = EFFECTS[effect_id].draw(np.random.default_rng(1))
    if effect_id == "amplifier_lowpass":
        values = {"cutoff_hz": 4e4, "filter_order": 4.0}
    records = {
        name: lab.drop(lab.a_rig(make_effect(effect_id, values, form=name)))[0]
        for name in EFFECTS[effect_id].forms
    }
    assert np.all(np.isfinite(records[form]))
    others = [np.max(np.abs(records[form] - v)) for name, v in records.items() if name != form]
    assert min(others) > 1e-5


def test_a_form_that_there_is_not_is_refused() -> None:
    """With the forms that there are."""
    with pytest.raises(ValueError, match="no form 'sneddon'; it has layer, dimitriadis"):
        make_effect("finite_thickness", {"thickness_m": 3e-3}, form="sneddon")
    with pytest.raises(ValueError, match="no form 'x'; it has none"):
        make_effect("echo", EFFECTS["echo"].neutral_values(), form="x")


def test_the_papers_rig_has_the_first_form_and_a_drawn_one_any() -> None:
    """No rig has the stiffening of both bodies."""
    rng = np.random.default_rng(3)
    found = {
        rig: {draw_effect(rng, among=["finite_thickness"], forms=rig).form for _ in range(60)}
        for rig in ("paper", "closed", "drawn")
    }
    assert found == {
        "paper": {"layer"},
        "closed": {"layer"},
        "drawn": {"dimitriadis", "garcia", "layer"},
    }


def test_forms_drawn_or_not_the_other_draws_of_a_seed_repeat() -> None:
    """With one form, a draw uses as much chance as it always did."""
    a, b = np.random.default_rng(8), np.random.default_rng(8)
    for _ in range(40):
        one, other = draw_effect(a), draw_effect(b, forms="closed")
        assert (one.id, one.values, one.scope) == (other.id, other.values, other.scope)


def test_a_layer_under_a_stiff_sphere_stiffens_as_dimitriadis_says_and_spares_a_soft_one(
    lab: Lab,
) -> None:
    """`whole` stiffens an acetal sphere on aluminium as much as on plastics; the others do not."""
    times = {}
    for surface in ("aluminium", "polycarbonate"):
        bare = lab.drop(lab.a_rig(), surface=surface)[1].contact_time_s
        for form in ("whole", "layer"):
            effect = make_effect("finite_thickness", {"thickness_m": 2e-3}, form=form)
            thin = lab.drop(lab.a_rig(effect), surface=surface)[1].contact_time_s
            times[surface, form] = 1.0 - thin / bare
    assert times["aluminium", "whole"] > 0.05
    assert times["aluminium", "layer"] < 0.005
    assert times["polycarbonate", "layer"] > 0.02


@pytest.mark.parametrize("order", range(1, 9))
def test_lowpasses_have_the_response_of_the_library(order: int) -> None:
    """Butterworth's and Bessel's, at the -3 dB frequency and two octaves around it."""
    cutoff_hz, rate_hz = 1e4, 4e6
    for form, design in (
        (butterworth, signal.butter(order, 2 * np.pi * cutoff_hz, analog=True)),
        (bessel, signal.bessel(order, 2 * np.pi * cutoff_hz, analog=True, norm="mag")),
    ):
        impulse = np.zeros(40_000)
        impulse[0] = 1.0
        found = form(cutoff_hz, order).process(impulse, 1 / rate_hz)
        for f in (0.5e4, 1e4, 2e4):
            w = 2 * np.pi * f
            heard = abs(np.sum(found * np.exp(-1j * w * np.arange(found.size) / rate_hz)))
            expected = abs(signal.freqs(*design, worN=[w])[1][0])
            assert heard == pytest.approx(expected, rel=2e-3)


def test_equal_rc_sections_are_3_db_down_together() -> None:
    """Order 4 at its cut-off."""
    impulse = np.zeros(40_000)
    impulse[0] = 1.0
    found = rc_sections(1e4, 4).process(impulse, 1 / 4e6)
    heard = abs(np.sum(found * np.exp(-2j * np.pi * 1e4 * np.arange(found.size) / 4e6)))
    assert heard == pytest.approx(math.sqrt(0.5), rel=2e-3)


def test_arms_of_a_relaxing_body_add_up_to_its_law() -> None:
    """The same strength at once; the power law is (1 + t/tau)^(-1/2) up to 1.5 tau."""
    for form in EFFECTS["stress_relaxation"].forms:
        assert sum(g for g, _ in arms(form, 0.2, 2e-5)) == pytest.approx(0.2)
    t = np.linspace(0.0, 3e-5, 50)
    held = sum(g * np.exp(-t / tau) for g, tau in arms("power_law", 0.2, 2e-5))
    np.testing.assert_allclose(held, 0.2 / np.sqrt(1 + t / 2e-5), rtol=2e-3)


def test_dmt_pulls_four_thirds_as_hard_as_jkr_and_lets_go_at_the_surface(lab: Lab) -> None:
    """4 pi gamma R against 3 pi gamma R; both slow the rebound."""
    base = lab.drop(lab.a_rig())[1]
    touches = {
        form: lab.drop(lab.with_form("adhesion", {"surface_energy_j_per_m2": 2.0}, form))[1]
        for form in ("jkr", "dmt")
    }
    assert touches["jkr"].rebound_speed_m_per_s < base.rebound_speed_m_per_s
    assert touches["dmt"].contact_time_s > base.contact_time_s


def test_damping_by_loss_factor_is_the_stated_one_under_a_coupon_of_four_grams(lab: Lab) -> None:
    """And grows as the root of the mass."""
    values = {"stiffness_n_per_m": 1e8, "damping_n_s_per_m": 100.0}
    ratios = {}
    for surface, mass_kg in (("polycarbonate", 3.6e-3), ("aluminium", 8.1e-3)):
        rig = lab.with_form("adhesive_layer", values, "loss_factor")
        damping = lab.bodies(rig, surface).layer_damping_n_s_per_m
        ratios[surface] = damping / math.sqrt(mass_kg)
    assert ratios["aluminium"] == pytest.approx(ratios["polycarbonate"])
    assert ratios["aluminium"] * math.sqrt(4e-3) == pytest.approx(100.0)
