"""A small simulated campaign, and the command line as one calls it without a process of its own."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.cli import app

Run = Callable[..., Result]


@pytest.fixture(scope="session")
def small_campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight shots of two spheres on two surfaces: their ``campaign.json``."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "hdpe")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
    )
    return write_campaign_folder(tmp_path_factory.mktemp("small"), simulate_campaign(settings, 5))


@pytest.fixture
def run() -> Run:
    """Return a function that runs the command line."""
    runner = CliRunner()

    def command(*words: object, **options: object) -> Result:
        return runner.invoke(app, [str(word) for word in words], **options)

    return command
