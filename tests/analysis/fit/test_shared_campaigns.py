"""The shared recordings: a campaign with known truth, and real ones in reduced units."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import pytest

from analysis import fit_campaign
from drivers.simulated.campaign import (
    CampaignSettings,
    simulate_campaign,
    write_campaign_folder,
)


def test_clean_campaign_gives_the_specimen_inside_its_interval(shared_campaign: Any) -> None:
    """On ``campaigns/clean`` KV fits to the noise and the specimen's truth is inside 95 %."""
    campaign, truth = shared_campaign("campaigns/clean")
    result = fit_campaign(campaign, "kv")
    assert result.outcome.status == "converged"
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.03)
    found = result.to_json()
    json.dumps(found, allow_nan=False)
    low, high = found["moduli"]["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low <= truth["specimen_youngs_modulus_Pa"] <= high
    for name, value in truth["sphere_youngs_modulus_Pa"].items():
        entry = found["moduli"][name]["youngs_modulus_Pa"]
        assert abs(entry["value"] - value) < 3 * entry["u"], name


def test_clean_campaign_shows_the_rigid_cells_bias(shared_campaign: Any) -> None:
    """On the same recordings HSD puts the specimen too high and admits a misfit."""
    campaign, truth = shared_campaign("campaigns/clean")
    result = fit_campaign(campaign, "hsd")
    specimen = result.moduli()["specimen"]["youngs_modulus_Pa"]
    assert specimen["value"] > 1.1 * truth["specimen_youngs_modulus_Pa"]
    assert "residual_above_noise" in result.flags()


@pytest.mark.parametrize("name", ["drop-tower", "repeated-shock", "sphere-taps"])
@pytest.mark.parametrize("model", ["hsd", "kv"])
def test_real_recordings_fit_in_reduced_units(shared_campaign: Any, name: str, model: str) -> None:
    """Others' recordings are fitted without masses and cell, with an honest finite R2."""
    campaign, _ = shared_campaign(f"data/{name}")
    campaign = dataclasses.replace(campaign, shots=campaign.shots[:25])
    result = fit_campaign(campaign, model)
    found = result.to_json()
    json.dumps(found, allow_nan=False)
    assert math.isfinite(found["r2"])
    assert 0.3 < found["r2"] < 0.999
    assert found["moduli"] == {}
    assert "residual_above_noise" in found["flags"]
    assert len(found["shots"]) + len(found["rejected"]) == len(campaign.shots)


@pytest.mark.parametrize("seed", [1, 4])
def test_simulated_rigs_campaign_is_recovered(
    read_campaign_folder: Any, tmp_path: Any, seed: int
) -> None:
    """A campaign of the simulated rig, which has its own physics, is recovered within 95 %."""
    simulated = simulate_campaign(CampaignSettings(), seed)
    write_campaign_folder(tmp_path, simulated)
    result = fit_campaign(read_campaign_folder(tmp_path), heldout=False)
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.03)
    assert result.flags() == []
    low, high = result.moduli()["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low <= simulated["truth"]["specimen_youngs_modulus_Pa"] <= high
