"""A rig with a real calibration in its archive: simulated drops, fitted by `calibrate`."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from typer.testing import CliRunner

from analysis import calibrate
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.cli import app
from impactd.storage.archive import Archive
from impactd.storage.campaign_folder import read_campaign
from tests.simulated_rig import write_simulated_rig

SECTION = """
[certificate]
laboratory = { name = "Impact Laboratory", street = "Fallweg 3", post_code = "38116", \
city = "Braunschweig", country_code = "DE", e_mail = "lab@example.org" }
customer = { name = "Tablet Works", city = "Basel", country_code = "CH" }
responsible = "A. Person"
role = "head of the laboratory"
performance_location = "laboratory"
cell_manufacturer = "Cell Works"
cell_model = "LC 201"
"""


@dataclass(frozen=True)
class Rig:
    """Settings with an archive, and the result of its only calibration."""

    config: Path
    data: Path
    result: dict[str, Any]

    def words(self) -> tuple[str, ...]:
        """Return the options that name it."""
        return ("--config", str(self.config), "--data", str(self.data))


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return eight shots of two spheres on two known surfaces."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "hdpe")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "polycarbonate")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
    )
    return write_campaign_folder(tmp_path_factory.mktemp("known"), simulate_campaign(settings, 5))


@pytest.fixture(scope="session")
def rig(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Rig:
    """Return a calibrated rig whose settings say who signs."""
    place = tmp_path_factory.mktemp("rig")
    config = write_simulated_rig(place, more=SECTION)
    result = calibrate(read_campaign(folder), "kv2").to_json()
    plan = [
        {"sphere": sphere, "surface": surface, "drop_height_m": 0.0465, "repeats": 1}
        for sphere in ("acetal", "hdpe")
        for surface in ("aluminium", "polycarbonate")
    ]
    with Archive.open(place / "data", reserve_bytes=0) as archive:
        begun, _ = archive.calibrations.begin(None, plan, "ab")
        archive.calibrations.finish(begun.number, result, "2030-01-01T00:00:00.000000Z")
    return Rig(config, place / "data", result)


@pytest.fixture(scope="session")
def run() -> Callable[..., Result]:
    """Return a function that runs the command line."""
    runner = CliRunner()
    return lambda *words: runner.invoke(app, [str(word) for word in words])


@pytest.fixture(scope="session")
def certificate(
    rig: Rig, run: Callable[..., Result], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return the certificate of the calibration."""
    out = tmp_path_factory.mktemp("out") / "certificate.xml"
    made = run("certificate", "write", "--identifier", "IL-2026-17", "--out", out, *rig.words())
    assert made.exit_code == 0, made.output
    return out
