"""Where a search for names looks, and when it may end: stated numbers are uncertain."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from analysis.campaign import Campaign, Uncertainty
from analysis.diagnosis.basis.proposals import proposals
from analysis.diagnosis.candidate import extended
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.multistart import usual_place
from analysis.diagnosis.successive_halving import (
    FEW,
    PresentModel,
    different,
    leaves_noise,
    ranked,
)
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.freed_inputs import is_far_whatever_is_stated
from analysis.fit.problem import JointProblem, build
from analysis.fit.settle import settle
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign

from .conftest import small_campaign

SOFT = {"stiffness_n_per_m": 1.8e7, "damping_n_s_per_m": 12.0}
"""A tape on which coupons ring for twenty periods."""


def three_surfaces(folder: Path, *effects: Effect) -> Campaign:
    """Return three spheres on three surfaces from three heights, as read back from a folder."""
    noise = NoiseSettings(1e-3)
    settings = dataclasses.replace(CampaignSettings(), repeats=1, noise=noise, effects=effects)
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 3)))


def on_soft_tape(
    campaign: Campaign, **values: float
) -> tuple[JointProblem, joint.Fitted, JointProblem, joint.Fitted]:
    """Return base model and adhesive layer from these values, each fitted from where it starts."""
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    begin = usual_place(problem, nuisances)
    at = {f"adhesive_layer.{name}": math.log(value) for name, value in values.items()}
    larger, theta, own = extended(problem, begin, effect_named("adhesive_layer"), at)
    own = settle(larger, theta, own)
    fitted = joint.fit_to_compare(larger, own, theta=theta)
    return problem, joint.fit_to_compare(problem, nuisances), larger, fitted


def test_a_fit_from_afar_goes_on_while_a_step_promises_much(tmp_path):
    """It begins at 1e5 times the noise's squares, and a ninth of them was no reason for a step."""
    campaign = small_campaign(tmp_path, "adhesive_layer", **SOFT)
    far = {"stiffness_n_per_m": 4e7, "damping_n_s_per_m": 300.0}
    *_, larger, ended = on_soft_tape(campaign, **far)
    promised = joint.promised_gain(larger, ended.blocks, ended.theta)
    assert not ended.converged or promised < 1e-3 * ended.cost


def test_a_coupon_that_weighs_otherwise_as_stated_leaves_much_and_no_structure(tmp_path):
    """The ring on a soft tape shows the mass much better than the stated 1e-3."""
    campaign = three_surfaces(tmp_path, make_effect("adhesive_layer", SOFT))
    surfaces, off = {}, (1.002, 0.999, 1.001)
    for times, (name, surface) in zip(off, campaign.surfaces.items(), strict=True):
        mass = times * surface.coupon_mass_kg
        u = Uncertainty(1e-3 * mass)
        surfaces[name] = dataclasses.replace(surface, coupon_mass_kg=mass, u_coupon_mass_kg=u)
    stated = dataclasses.replace(campaign, surfaces=surfaces)
    problem, base, larger, fitted = on_soft_tape(stated, **SOFT)
    assert joint.is_hopeless(larger, fitted.cost)
    assert not is_far_whatever_is_stated(larger, fitted)
    assert leaves_noise(larger, fitted)
    assert is_far_whatever_is_stated(problem, base)


def test_three_shots_that_differ_have_three_spheres_and_three_surfaces(tmp_path):
    """Diagonally, whatever the order of the drops; and from three heights."""
    problem = build(three_surfaces(tmp_path), model_named("kv2"))
    three = [problem.shots[i] for i in different(problem, 3)]
    assert [len({getattr(i.shot, name) for i in three}) for name in ("sphere", "surface")] == [3, 3]
    assert len({i.shot.drop_height_m for i in three}) == 3


def with_mass(campaign: Campaign, *, times: float, u: float) -> Campaign:
    """Return a campaign that states another mass of one sphere, with a relative uncertainty."""
    name = sorted(campaign.spheres)[0]
    ball = campaign.spheres[name]
    mass = times * ball.mass_kg
    ball = dataclasses.replace(ball, mass_kg=mass, u_mass_kg=Uncertainty(u * mass))
    return dataclasses.replace(campaign, spheres={**campaign.spheres, name: ball})


@pytest.mark.parametrize(("u", "noise"), [(0.03, True), (0.0003, False)])
def test_a_mass_that_is_off_as_stated_leaves_noise(tmp_path, u, noise):
    """A mass 3 % off shows in the squares; it is no effect where 3 % is stated of it."""
    campaign = with_mass(small_campaign(tmp_path), times=1.03, u=u)
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    fitted = joint.fit(problem, nuisances)
    assert fitted.cost > 1.01 * sum(item.expected_squares for item in problem.shots)
    assert leaves_noise(problem, fitted) is noise


@pytest.mark.slow
def test_what_nine_shots_do_not_show_is_sought_on_all(tmp_path):
    """A faint relaxation: nine shots leave noise, so all are asked, and every candidate on all."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=6,
        noise=NoiseSettings(2.5e-3),
        effects=(make_effect("stress_relaxation", {"strength": 0.015, "relaxation_time_s": 6e-6}),),
    )
    campaign = read_campaign(write_campaign_folder(tmp_path, simulate_campaign(settings, 7)))
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    fitted = joint.fit(problem, nuisances)
    excess = fitted.cost - sum(item.expected_squares for item in problem.shots)
    assert FEW / len(problem.shots) * excess < CRITERIA.curved_squares
    present = PresentModel(problem, fitted, usual_place(problem, nuisances))
    found = ranked(present, proposals(problem)[0], lambda stage, share: None)
    assert found[0].effect_id == "stress_relaxation"
    assert all(one.on_all_shots for one in found)
