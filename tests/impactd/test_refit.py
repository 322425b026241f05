"""A re-fit does every shot once, whatever is killed, and keeps what is bad to itself."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd.console.refit import executor_named
from impactd.refit import CHUNK, RefitReport, refit
from impactd.settings.materials import load_materials
from impactd.settings.settings import Settings, find_config, load_settings
from impactd.storage.archive import Archive, ArchiveError

LIVELINESS_S = 120.0
SHOTS = 3 * CHUNK


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """Return the simulated rig's settings over an archive of its own."""
    return load_settings(find_config("simulated.toml"), data=tmp_path / "archive")


@pytest.fixture
def archive(settings: Settings, tmp_path: Path) -> Iterator[Archive]:
    """Return an archive with three chunks of shots, one of them unreadable."""
    small = CampaignSettings(
        spheres={"acetal": SPHERES["acetal"]},
        surfaces={"polycarbonate": SURFACES["polycarbonate"]},
        drop_heights_m=(0.03,),
        repeats=SHOTS,
    )
    folder = write_campaign_folder(tmp_path / "campaign", simulate_campaign(small, 1))
    with Archive.open(settings.storage.directory, reserve_bytes=0) as opened:
        opened.import_campaign(folder)
        yield opened


def run(archive: Archive, settings: Settings, kind: str = "process", **options: str) -> RefitReport:
    """Re-fit with one worker and the model kv."""
    materials = load_materials(settings.materials.file)
    with executor_named(kind, settings, workers=1) as executor:
        return refit(archive, settings, materials, executor, models=("kv",), **options)


def fits_per_shot(archive: Archive) -> Counter[int | None]:
    """Return how many fits each shot has."""
    rows = archive.fits._index.rows("SELECT shot FROM fits")
    return Counter(row["shot"] for row in rows)


def test_every_shot_is_fitted_once_and_a_second_start_finds_nothing_to_do(
    archive: Archive, settings: Settings
) -> None:
    """The same knowledge is the same run; another label is another one."""
    first = run(archive, settings)
    assert (first.before, first.fitted, first.failed) == (0, SHOTS, {})
    again = run(archive, settings)
    assert (again.run, again.before, again.fitted) == (first.run, SHOTS, 0)
    assert set(fits_per_shot(archive).values()) == {1}
    fit = archive.fits.for_shot(1)[0]
    assert fit.result["outcome"]["status"] == "converged"
    other = run(archive, settings, label="again")
    assert other.run != first.run
    assert set(fits_per_shot(archive).values()) == {2}


def test_a_damaged_file_fails_by_itself_and_is_tried_again_later(
    archive: Archive, settings: Settings
) -> None:
    """One bad file costs its shot and none of its neighbours."""
    bad = archive.shots(limit=1)[0].number
    path = archive.shot_path(bad)
    whole = path.read_bytes()
    path.chmod(0o640)
    path.write_bytes(whole[:-1])
    report = run(archive, settings)
    assert list(report.failed) == [bad]
    assert "SHA-256" in report.failed[bad]
    assert report.fitted == SHOTS - 1
    path.write_bytes(whole)
    assert run(archive, settings).fitted == 1


def test_two_at_once_are_refused(archive: Archive, settings: Settings) -> None:
    """The second re-fit says that another one is under way; it would do the same shots."""
    import fcntl  # noqa: PLC0415 - only this test plays the other process

    with (settings.storage.directory / "refit.lock").open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(ArchiveError, match="under way"):
            run(archive, settings)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["process", "dask"])
def test_killed_half_way_and_started_again_every_shot_is_fitted_once(
    archive: Archive, settings: Settings, kind: str
) -> None:
    """SIGKILL in the middle: the next start does what is left, and nothing twice."""
    command = [sys.executable, "-m", "impactd", "refit", "--executor", kind, "--model", "kv"]
    command += ["--config", str(find_config("simulated.toml"))]
    command += ["--data", str(settings.storage.directory)]
    process = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + LIVELINESS_S
    while not fits_per_shot(archive) and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    done = len(fits_per_shot(archive))
    assert done > 0
    report = run(archive, settings, kind)
    assert report.before == done
    assert report.before + report.fitted == SHOTS
    assert set(fits_per_shot(archive).values()) == {1}
    assert len(fits_per_shot(archive)) == SHOTS
