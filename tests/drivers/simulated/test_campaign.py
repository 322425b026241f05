"""Simulated campaigns in the exchange format."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.specimens import SPHERES, SURFACES

SMALL = {
    "spheres": {"acetal": SPHERES["acetal"]},
    "surfaces": {"specimen": SURFACES["specimen"]},
    "repeats": 1,
}


def test_a_campaign_has_the_shape_of_the_examples() -> None:
    """54 records of 4096 codes, a pulse near sample 1500, in time order."""
    made = simulate_campaign(CampaignSettings(), 1)
    shots = made["campaign"]["shots"]
    assert len(shots) == len(made["codes"]) == len(made["truth"]["shots"]) == 54
    assert [s["file"] for s in shots[:2]] == ["shot000.npy", "shot001.npy"]
    for shot, codes in zip(shots, made["codes"], strict=True):
        assert codes.dtype == np.int16
        assert codes.shape == (4096,)
        assert 1500 <= shot["trigger_index"] < 1530
    peak = max(int(np.max(codes)) for codes in made["codes"])
    assert 0.7 < peak / 32768 < 1.0
    assert json.loads(json.dumps(made["campaign"], allow_nan=False)) == made["campaign"]


def test_noise_before_the_trigger_is_correlated_as_declared() -> None:
    """AR(1) with 0.6 at 1.5 mV."""
    made = simulate_campaign(CampaignSettings(), 1)
    quiet = np.array([c[:1450] for c in made["codes"]], dtype=float) * 20 / 65536
    quiet -= quiet.mean(axis=1, keepdims=True)
    assert np.std(quiet) == pytest.approx(1.5e-3, rel=0.03)
    rho = np.mean(quiet[:, 1:] * quiet[:, :-1]) / np.var(quiet)
    assert rho == pytest.approx(0.6, abs=0.02)


def test_same_seed_gives_the_same_campaign() -> None:
    """To the last code; another seed gives another."""
    a, b, c = (simulate_campaign(CampaignSettings(**SMALL), s) for s in (4, 4, 5))  # type: ignore[arg-type]
    assert a["campaign"] == b["campaign"]
    assert all(np.array_equal(x, y) for x, y in zip(a["codes"], b["codes"], strict=True))
    assert a["truth"]["specimen_youngs_modulus_Pa"] != c["truth"]["specimen_youngs_modulus_Pa"]


def test_an_effect_leaves_everything_else_as_it_was() -> None:
    """With and without it, the same seed has the same noise, plan and materials."""
    tail = make_effect("coupler_highpass", {"time_constant_s": 1e-3})
    bare = simulate_campaign(CampaignSettings(**SMALL), 4)  # type: ignore[arg-type]
    made = simulate_campaign(CampaignSettings(effects=(tail,), **SMALL), 4)  # type: ignore[arg-type]
    assert made["truth"]["spheres"] == bare["truth"]["spheres"]
    for a, b in zip(bare["codes"], made["codes"], strict=True):
        np.testing.assert_array_equal(a[:1490], b[:1490])
        assert np.mean(b[2500:]) < np.mean(a[2500:])
    assert made["truth"]["effects"][0]["id"] == "coupler_highpass"


def test_stated_rebound_is_the_true_one_within_its_uncertainty() -> None:
    """And is off by gravity where the camera looks late."""
    for late_s, offset in ((0.0, 0.0), (2.58e-3, 9.80665 * 2.58e-3)):
        settings = CampaignSettings(restitution_seen_after_s=late_s)
        made = simulate_campaign(settings, 7)
        deviations = [
            s["restitution"]["value"] - (t["rebound_speed_m_per_s"] - offset) / t["speed_m_per_s"]
            for s, t in zip(made["campaign"]["shots"], made["truth"]["shots"], strict=True)
        ]
        assert np.std(deviations) == pytest.approx(0.01, rel=0.3)
        assert abs(np.mean(deviations)) < 0.004


def test_a_rigid_cell_is_described_by_its_one_number() -> None:
    """HSD campaigns carry S alone, and every effect of the base model may be drawn."""
    made = simulate_campaign(
        CampaignSettings(cell_model="hsd", effects="random", **SMALL),  # type: ignore[arg-type]
        3,
    )
    assert set(made["campaign"]["sensor"]) == {"hsd_N_per_V"}
    assert len(made["truth"]["effects"]) == 1


def test_a_folder_holds_campaign_shots_and_truth(tmp_path: Path) -> None:
    """What is written is what was simulated."""
    made = simulate_campaign(CampaignSettings(**SMALL), 2)  # type: ignore[arg-type]
    path = write_campaign_folder(tmp_path / "c", made)
    assert json.loads(path.read_text()) == made["campaign"]
    np.testing.assert_array_equal(np.load(tmp_path / "c" / "shot001.npy"), made["codes"][1])
    assert json.loads((tmp_path / "c" / "truth.json").read_text()) == made["truth"]
