"""When the search for names may end: what is left is noise, stated numbers being uncertain."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.campaign import Campaign, Uncertainty
from analysis.diagnosis.successive_halving import leaves_noise
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

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
