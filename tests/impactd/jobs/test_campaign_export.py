"""A shot gives the same number by the daemon and by a folder that left it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest

from analysis import fit_campaign
from impactd.advice import best_fit
from impactd.jobs.campaign_export import export_campaign
from impactd.storage.campaign_folder import read_campaign
from impactd.storage.errors import CampaignError
from tests.impactd.api.conftest import Rig, run_daemon, simulated_settings, until

PLAN = [
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.025, "repeats": 2},
    {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.045, "repeats": 1},
]
DROP = {"sphere": "acetal", "surface": "specimen", "drop_height_m": 0.045, "operator": "ab"}


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """A rig that was calibrated, and made one drop afterwards."""
    for rig in run_daemon(simulated_settings(tmp_path_factory.mktemp("rig"))):
        made = rig.operator.post("/v1/calibrations", json={"plan": PLAN, "slot": "one"})
        until(
            lambda rig=rig, at=made.headers["location"]: rig.reader.get(at).json(),
            lambda found: found["state"] in ("done", "failed"),
        )
        rig.drop(DROP)
        rig.ended(4, ("analysed", "failed"))
        yield rig


def exported(rig: Rig, numbers: list[int], out: Path) -> Path:
    """Write shots as the command does."""
    return export_campaign(
        rig.daemon.archive,
        numbers,
        out,
        settings=rig.daemon.settings,
        book=rig.daemon.book,
    )


def test_an_exported_shot_gives_the_number_of_its_drop(calibrated, tmp_path):
    """Value and uncertainty of E*, calibration included, to what a fit settles to."""
    file = exported(calibrated, [4], tmp_path / "out")
    said = json.loads(file.read_text())
    assert said["calibration"]["number"] == 1
    assert "log_covariance" in said["calibration"]["sensor"]
    fit = best_fit(calibrated.daemon.archive.fits.for_shot(4))
    assert fit is not None
    before = fit.result["reduced_modulus_Pa"]
    result = fit_campaign(read_campaign(file), fit.model).to_json()
    after = result["pairs"]["acetal/specimen"]["reduced_modulus_Pa"]
    for key in ("value", "u"):
        assert math.isclose(before[key], after[key], rel_tol=1e-5), (key, before, after)


def test_a_diagnosis_of_an_exported_shot_starts_from_the_certificate(calibrated, tmp_path):
    """A calibration made under the model in question would vouch for it."""
    file = exported(calibrated, [4], tmp_path / "out")
    certificate = calibrated.daemon.settings.sensor.sensor()
    assert read_campaign(file, calibrated=False).sensor == certificate
    assert read_campaign(file).sensor != certificate


def test_shots_of_the_calibration_itself_leave_without_it(calibrated, tmp_path):
    """It would vouch for itself; the folder says so."""
    calibrated.operator.post("/v1/fits", json={"shots": [1], "model": "kv2"})
    said = json.loads(exported(calibrated, [1, 4], tmp_path / "out").read_text())
    assert "calibration" not in said
    assert "cannot confirm itself" in said["assumptions"][0]


def test_a_calibration_without_a_cell_is_refused_by_its_path(calibrated, tmp_path):
    """The message names the member that is missing."""
    file = exported(calibrated, [4], tmp_path / "out")
    said = json.loads(file.read_text())
    del said["calibration"]["sensor"]
    file.write_text(json.dumps(said))
    with pytest.raises(CampaignError) as error:
        read_campaign(file)
    assert error.value.json_path == "$.calibration.sensor"
