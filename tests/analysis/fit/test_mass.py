"""What a fit may say where the sphere's mass is stated, and where it is not."""

from __future__ import annotations

import dataclasses
import math

import pytest

from analysis.campaign import Campaign, Sphere
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.result import FitResult
from tests.analysis.any_rate import Scale, campaign_at

QUANTITIES = ("force_N", "acceleration_m_per_s2", "voltage")


def _fitted(quantity: str, mass_kg: float | None, **of_shots: float) -> FitResult:
    """Return the fit of six shots of 100 us, the sphere's mass as stated."""
    scale = Scale(1e6, 100, quantity, ring_per_contact=2.0)
    campaign = campaign_at(scale)
    shots = tuple(dataclasses.replace(s, **of_shots) for s in campaign.shots)
    spheres = {"ball": Sphere("ball", mass_kg=mass_kg)}
    return fit_campaign(
        Campaign(shots, spheres, campaign.surfaces, gravity_m_per_s2=1e-9), heldout=False
    )


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_a_stated_mass_gives_k_and_no_mass_gives_k_per_mass(quantity: str) -> None:
    """K is stated with a mass, K over m without; volts without a gain have neither in SI."""
    (known,), (unknown,) = (list(_fitted(quantity, mass).pairs().values()) for mass in (0.1, None))
    assert ("stiffness" in known) == (quantity != "voltage")
    assert ("stiffness_over_mass" in known) == (quantity == "voltage")
    assert "stiffness" not in unknown
    assert unknown["stiffness_over_mass"]["unit"] == "N m^-1.5 kg^-1"


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_no_speed_is_stated_where_no_mass_tells_it(quantity: str) -> None:
    """Without a mass only an acceleration tells a speed in m/s, and the assumptions say so."""
    fit = _fitted(quantity, None)
    told = quantity == "acceleration_m_per_s2"
    assert all((s.to_json()["impact_speed_m_per_s"] is not None) == told for s in fit.shots)
    assert any("No mass given for ball" in s for s in fit.problem.assumptions)
    assert any("no speed in m/s" in s for s in fit.problem.assumptions) != told
    document = fit.to_json()["parameters"]
    assert document["pair.ball/plate"]["unit"] == "N m^-1.5 kg^-1"


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_another_mass_alone_leads_to_the_same_optimum(quantity: str) -> None:
    """The residual is the same, K goes with m of an acceleration and with m^1.5 of a force."""
    light, heavy = (_fitted(quantity, mass) for mass in (0.1, 1.0))
    assert heavy.chi2_per_dof == pytest.approx(light.chi2_per_dof, rel=1e-3)
    power = 1.0 if quantity == "acceleration_m_per_s2" else 1.5
    j = light.problem.names.index("pair.ball/plate")
    ratio = math.exp(heavy.fitted.theta[j] - light.fitted.theta[j])
    assert ratio == pytest.approx(10.0**power, rel=0.02)


def test_a_height_promises_no_speed_of_a_sphere_of_unknown_mass() -> None:
    """A force says m v: with a height, too, the fit of a sphere without a mass is in its units."""
    with_height, without = (
        _fitted("force_N", None, **own) for own in ({"drop_height_m": 0.05}, {})
    )
    assert with_height.chi2_per_dof == pytest.approx(without.chi2_per_dof, rel=1e-6)
