"""Where a search for names looks, and when it may end: stated numbers are uncertain."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.campaign import Campaign, Uncertainty
from analysis.diagnosis.basis.proposals import proposals
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.multistart import usual_place
from analysis.diagnosis.successive_halving import (
    FEW,
    PresentModel,
    leaves_noise,
    ranked,
)
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign

from .conftest import small_campaign


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
    assert fitted.cost > 1.01 * sum(item.data for item in problem.shots)
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
    excess = fitted.cost - sum(item.data for item in problem.shots)
    assert FEW / len(problem.shots) * excess < CRITERIA.curved_squares
    present = PresentModel(problem, fitted, usual_place(problem, nuisances))
    found = ranked(present, proposals(problem)[0], lambda stage, share: None)
    assert found[0].effect_id == "stress_relaxation"
    assert all(one.on_all_shots for one in found)
