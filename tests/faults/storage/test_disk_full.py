"""The disk is full, in steps of 64 KiB, before and during a drop."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from ..conftest import Disk
from .daemon_here import DaemonHere, daemon_here
from .daemon_process import ENDED, until

STEP = 64 * 1024
IN_MEMORY = "keeps its record in memory"


@pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.slow)])
def test_below_the_reserve_nothing_is_armed(disk: Disk, every: int) -> None:
    """Around the reserve: 507 with what to do below it, 202 above it, and no sphere falls below."""
    reserve = 48 * STEP
    refused = 0
    with daemon_here(disk.path / "data", storage={"reserve_bytes": reserve}) as here:
        for step in range(36, 72, every):
            disk.leave(step * STEP)
            fallen = here.world._releases
            answer = here.drop(f"step-{step}")
            if answer.status_code == 507:
                refused += 1
                assert disk.free() < reserve
                assert "storage.directory" in answer.json()["remedy"]
                assert here.world._releases == fallen
                assert "reserve" in here.get("/v1/status")["sentence"]
                calibration = here.client.post(
                    "/v1/calibrations", json={}, headers={"Idempotency-Key": f"run-{step}"}
                )
                assert calibration.status_code == 507, calibration.text
            else:
                assert answer.status_code == 202, answer.text
                _ended(here, answer.json()["number"])
                disk.leave(20 * 1024 * 1024)
                here.ready()
        disk.leave(20 * 1024 * 1024)
        here.ready()
    assert refused
    print(f"reserve: {len(range(36, 72, every))} steps of 64 KiB, {refused} refused with 507")


@pytest.mark.parametrize("every", [5, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.timeout(1200)
def test_a_record_in_memory_is_stored_when_space_returns(disk: Disk, every: int) -> None:
    """With any space left: refused with 507, or stored, if need be once space returns."""
    counts = {"refused": 0, "stored at once": 0, "stored when space returned": 0, "failed": 0}
    with daemon_here(disk.path / "data") as here:
        for step in range(0, 30, every):
            disk.leave(step * STEP)
            fallen = here.world._releases
            answer = here.drop(f"step-{step}")
            if answer.status_code == 507:
                counts["refused"] += 1
                assert answer.json()["remedy"]
                assert here.world._releases == fallen
                disk.leave(8 * 1024 * 1024)
                here.ready()
                continue
            assert answer.status_code == 202, answer.text
            number = answer.json()["number"]
            found = until(lambda n=number: _where(here, n), bool)
            if found == "row not closed":
                assert "disk" in here.get("/v1/status")["sentence"]
            if found == "memory":
                sentence = here.get("/v1/status")["sentence"]
                assert sentence.startswith("NOT READY")
                assert "Free space" in sentence
                counts["stored when space returned"] += 1
            disk.leave(8 * 1024 * 1024)
            drop = _ended(here, number)
            if found == "ended" and drop["state"] in ("stored", "analysed"):
                counts["stored at once"] += 1
            if here.world._releases > fallen:
                assert drop["state"] in ("stored", "analysed"), drop
                here.daemon.archive.read_shot(number)
            else:
                counts["failed"] += 1
                assert drop["problem"]["type"] == "urn:impactd:problem:disk-full"
            here.ready()
        assert [found.problem for found in here.daemon.archive.verify() if found.problem] == []
        assert all(here.daemon.liveness().values())
    assert counts["stored when space returned"]
    print(f"disk full, {len(range(0, 30, every))} steps of 64 KiB: {counts}")


def test_a_record_in_memory_outlives_the_daemon(
    disk: Disk,
    tmp_path: Path,
    lasting_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Told to end with a full disk, it keeps the record elsewhere; the next start stores it.

    The folder for temporary files goes with the daemon, as systemd's PrivateTmp does.
    """
    private = tmp_path / "private"
    private.mkdir()
    monkeypatch.setenv("TMPDIR", str(private))
    monkeypatch.setenv("CACHE_DIRECTORY", str(private))
    data = disk.path / "data"
    elsewhere = {"reserve_bytes": 0, "rescue_directory": lasting_folder}
    with daemon_here(data, storage=elsewhere) as here:
        disk.leave(10 * STEP)
        number = here.drop("last").json()["number"]
        assert until(lambda: _where(here, number), bool) == "memory"
    said = "".join(capfd.readouterr())
    assert str(lasting_folder) in said
    assert "Traceback" not in said, "a log on a full disk takes one line for what it could not take"
    shutil.rmtree(private)
    kept = list(lasting_folder.rglob("*.h5"))
    assert [path.name for path in kept] == [f"{number:06d}.h5"]
    disk.leave(8 * 1024 * 1024)
    with daemon_here(data, secret=here.secret, storage=elsewhere) as here:
        assert here.get(f"/v1/drops/{number}")["state"] in ("stored", "analysed")
        here.daemon.archive.read_shot(number)
        assert here.drop("last").json()["number"] == number
    assert not kept[0].exists()


def _where(here: DaemonHere, number: int) -> str:
    if here.client.get(f"/v1/drops/{number}").json()["state"] in ENDED:
        return "ended"
    status = here.get("/v1/status")
    if IN_MEMORY in status["sentence"]:
        return "memory"
    # Refused before the release, and not even that could be written: said by the light.
    return "row not closed" if status["state"] == "FAULT" else ""


def _ended(here: DaemonHere, number: int) -> dict[str, object]:
    return until(lambda: here.get(f"/v1/drops/{number}"), lambda drop: drop["state"] in ENDED)
