"""Numbers of single shots are told with what they follow, and with nothing where chance rules."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.document.per_shot import dependence
from analysis.fit.problem import FitShot, build
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[FitShot]:
    """Fifty-four shots of three spheres, three coupons and three heights."""
    folder = tmp_path_factory.mktemp("shots")
    campaign = read_campaign(
        write_campaign_folder(folder, simulate_campaign(CampaignSettings(), 2))
    )
    return build(campaign, model_named("kv2")).shots


def test_chance_goes_with_nothing(shots: list[FitShot]) -> None:
    """Of 200 draws none is said to follow anything."""
    rng = np.random.default_rng(1)
    assert not any(dependence(rng.standard_normal(len(shots)).tolist(), shots) for _ in range(200))
    assert dependence([1.0] * len(shots), shots) == []
    assert dependence([1.0, 2.0], shots[:2]) == []


def test_what_grows_on_one_coupon_is_told_with_the_coupon_and_the_order(
    shots: list[FitShot],
) -> None:
    """The others stay at nothing, and do not hide that it grows."""
    rng = np.random.default_rng(2)
    sizes = [
        1e-3 * (k / len(shots)) ** 2 * (s.shot.surface == "polycarbonate")
        for k, s in enumerate(shots)
    ]
    said = dependence((np.array(sizes) + 1e-6 * rng.standard_normal(len(shots))).tolist(), shots)
    assert len(said) == 2
    assert said[0].startswith("goes with the coupon: aluminium ")
    assert said[1].startswith("rises from drop to drop on polycarbonate, rank correlation ")


def test_a_number_that_follows_the_height_falls_with_it(shots: list[FitShot]) -> None:
    """Over all shots, whatever they fall on."""
    rng = np.random.default_rng(3)
    values = [1.0 / (s.shot.drop_height_m or 1.0) + rng.normal() for s in shots]
    said = dependence(values, shots)
    assert any(
        line.startswith("falls with the drop height, rank correlation -0.9") for line in said
    )
