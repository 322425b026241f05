"""Into the archive and out of it again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.digitizer import Record
from impactd.storage.archive import Archive, ArchiveError, CampaignError, DropRequest, ShotMetadata
from impactd.storage.campaign_folder import read_campaign

Make = Callable[..., Path]


def test_an_import_takes_the_next_numbers(
    archive: Archive, stored: Callable[..., int], campaign_folder: Make
) -> None:
    """Imported shots stand in the same sequence as drops and remember where they came from."""
    stored()

    report = archive.import_campaign(campaign_folder())

    assert report.numbers == (2, 3, 4)
    shot = archive.read_shot(2)
    assert shot.shot.source == "import"
    assert shot.metadata.origin.startswith("campaign/shot000.npy sha256:")
    assert shot.metadata.sensor is not None
    assert shot.drop is None
    assert archive.begin_drop(DropRequest("a", "b", 0.1, "x"), owner="a")[0].number == 5


def test_importing_twice_stores_once(archive: Archive, campaign_folder: Make) -> None:
    """The same samples are recognised and not stored again."""
    folder = campaign_folder()
    archive.import_campaign(folder)

    again = archive.import_campaign(folder / "campaign.json")

    assert (again.numbers, again.already) == ((), (1, 2, 3))


def test_a_bad_shot_does_not_stop_an_import(archive: Archive, campaign_folder: Make) -> None:
    """The rest is stored, and the bad one is listed with its reason."""

    def change(root: dict[str, Any], _: Path) -> None:
        root["shots"][0]["sphere"] = "marble"

    report = archive.import_campaign(campaign_folder(change))

    assert len(report.numbers) == 2
    assert report.rejected[0].path == "$.shots[0].sphere"


def test_a_bad_folder_stores_nothing(archive: Archive, tmp_path: Path) -> None:
    """Nothing is stored from a folder that cannot be read."""
    with pytest.raises(CampaignError):
        archive.import_campaign(tmp_path)

    assert archive.shots() == []


def test_a_campaign_survives_the_archive(
    archive: Archive, campaign_folder: Make, tmp_path: Path
) -> None:
    """Import and export give back the same codes, materials and sensor."""
    folder = campaign_folder()
    numbers = archive.import_campaign(folder).numbers

    (path,) = archive.export(numbers, "campaign", tmp_path / "out")
    before, after = read_campaign(folder), read_campaign(path)

    assert after.sensor == before.sensor
    assert after.spheres == before.spheres
    for one, other in zip(before.shots, after.shots, strict=True):
        assert np.array_equal(one.signal, other.signal)
        assert one.drop_height_m == other.drop_height_m
        assert one.restitution == other.restitution


def test_npz_and_csv_hold_time_signal_and_facts(
    archive: Archive, stored: Callable[..., int], tmp_path: Path
) -> None:
    """Both formats give volts over seconds from the trigger, and say everything else as JSON."""
    number = stored()
    signal = archive.read_shot(number).recording.signal

    (npz,) = archive.export([number], "npz", tmp_path)
    (csv,) = archive.export([number], "csv", tmp_path)

    with np.load(npz) as held:
        assert np.array_equal(held["signal"], signal)
        assert held["time_s"][1000] == 0.0
        assert json.loads(str(held["facts_json"]))["number"] == number
    assert csv.read_text().startswith("time_s,volts\n")
    assert np.allclose(np.loadtxt(csv, delimiter=",", skiprows=1)[:, 1], signal, atol=1e-8)
    facts = json.loads(csv.with_suffix(".json").read_text())
    assert facts["file_sha256"] == archive.shot(number).sha256


def test_an_exported_file_is_never_overwritten(
    archive: Archive, stored: Callable[..., int], tmp_path: Path
) -> None:
    """A second export into the same folder is refused."""
    number = stored()
    archive.export([number], "npz", tmp_path)

    with pytest.raises(ArchiveError, match="exists already"):
        archive.export([number], "npz", tmp_path)


def test_an_unknown_format_is_refused(archive: Archive, stored: Callable[..., int]) -> None:
    """The message lists the formats there are."""
    with pytest.raises(ArchiveError, match="csv, npz, campaign"):
        archive.export([stored()], "xlsx", archive.directory)


def test_shots_that_disagree_make_no_campaign(
    archive: Archive,
    campaign_folder: Make,
    record: Callable[..., Record],
    metadata: ShotMetadata,
    tmp_path: Path,
) -> None:
    """Two shots that describe one sphere differently are not put together silently."""

    def change(root: dict[str, Any], _: Path) -> None:
        root["spheres"]["acetal"]["mass_kg"] = 0.0007

    drop, _ = archive.begin_drop(DropRequest("acetal", "polycarbonate", 0.047, "ab"), owner="a")
    archive.store_shot(drop.number, record(), metadata)
    numbers = archive.import_campaign(campaign_folder(change)).numbers

    with pytest.raises(ArchiveError, match="'acetal'"):
        archive.export([drop.number, numbers[0]], "campaign", tmp_path / "out")
