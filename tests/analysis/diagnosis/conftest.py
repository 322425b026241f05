"""Small simulated campaigns and their diagnoses: two spheres, two surfaces, two heights."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from drivers.simulated.rig_model import DEFAULT_RIG
from impactd.storage.campaign_folder import read_campaign

SEED = 3


def small_campaign(
    folder: Path, effect: str | None = None, rig: str = DEFAULT_RIG, **values: float
) -> Campaign:
    """Return eight shots with one effect, as read back from a campaign folder."""
    return campaign_with(folder, () if effect is None else (make_effect(effect, values),), rig)


def campaign_with(
    folder: Path,
    effects: tuple[Effect, ...],
    rig: str = DEFAULT_RIG,
    seed: int = SEED,
    repeats: int = 1,
) -> Campaign:
    """Return eight shots, or so many times eight, with any effects, as read back from a folder."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=repeats,
        effects=effects,
        rig=rig,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, seed)))


@pytest.fixture(scope="session")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """A campaign that hides nothing."""
    return diagnose_campaign(small_campaign(tmp_path_factory.mktemp("clean")))


@pytest.fixture(scope="session")
def leaky(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """A campaign through a coupler that forgets within 5 ms."""
    folder = tmp_path_factory.mktemp("leaky")
    return diagnose_campaign(small_campaign(folder, "coupler_highpass", time_constant_s=5e-3))
