"""A small campaign with a leaky coupler, and its diagnosis."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.rig_model import DEFAULT_RIG
from impactd.diagnosis.run import diagnose
from impactd.storage.campaign_folder import read_campaign


@pytest.fixture(scope="session")
def leaky_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight shots through a coupler that forgets within 5 ms: their ``campaign.json``."""
    return _leaky(tmp_path_factory.mktemp("leaky"), DEFAULT_RIG)


@pytest.fixture(scope="session")
def papers_leaky_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same on a rig that is the paper's."""
    return _leaky(tmp_path_factory.mktemp("papers"), "paper")


def _leaky(folder: Path, rig: str) -> Path:
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        rig=rig,
        effects=(make_effect("coupler_highpass", {"time_constant_s": 5e-3}),),
    )
    return write_campaign_folder(folder, simulate_campaign(settings, 3))


@pytest.fixture(scope="session")
def document(leaky_campaign: Path) -> dict[str, Any]:
    """Its diagnosis, as it comes back from a file."""
    found = json.loads(json.dumps(diagnose(read_campaign(leaky_campaign)), allow_nan=False))
    assert isinstance(found, dict)
    return found
