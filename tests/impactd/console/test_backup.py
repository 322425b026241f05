"""A backup of a working daemon becomes the same archive on an empty machine."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.impactd.api.conftest import run_daemon, simulated_settings


def impactd(*words: str, **more: str) -> subprocess.CompletedProcess[str]:
    """Run a command."""
    return subprocess.run(
        [sys.executable, "-m", "impactd", *words],
        env={**os.environ, **more}, capture_output=True, text=True, check=False,
    )  # fmt: skip


def test_a_backup_is_the_whole_archive(tmp_path: Path) -> None:
    """Shots, fits, moduli and tokens are there again; damage and a full folder are refused."""
    settings = simulated_settings(tmp_path / "data")
    where = ("--config", "config/simulated.toml", "--data")
    backup, new = tmp_path / "backup.tar", tmp_path / "new"
    running = run_daemon(settings)
    rig = next(running)
    shot = rig.analysed_shot()
    token = rig.token("read", "kept")
    rig.daemon.recordings.keep("mine", "drop-1.csv", b"0,1\n")
    made = impactd("backup", str(backup), *where, str(tmp_path / "data"))
    assert made.returncode == 0, made.stderr
    before = rig.reader.get("/v1/moduli").json()["moduli"]
    with pytest.raises(StopIteration):
        next(running)
    refused = impactd("restore", str(backup), *where, str(tmp_path / "data"))
    assert refused.returncode == 1
    assert "not empty" in refused.stderr
    made = impactd("restore", str(backup), *where, str(new))
    assert made.returncode == 0, made.stdout + made.stderr
    assert "1 shot and" in made.stdout
    assert impactd("verify", *where, str(new)).returncode == 0
    running = run_daemon(simulated_settings(new))
    rig = next(running)
    again = rig.reader.get(f"/v1/shots/{shot['number']}").json()
    assert again["sha256"] == shot["sha256"]
    assert {fit["model"] for fit in again["fits"]} == {fit["model"] for fit in shot["fits"]}
    assert rig.reader.get("/v1/moduli").json()["moduli"] == before
    assert rig.daemon.recordings.get("mine").files[0].read_bytes() == b"0,1\n"
    answer = rig.anybody.get("/v1/shots", headers={"Authorization": f"Bearer {token}"})
    assert answer.status_code == 200
    with pytest.raises(StopIteration):
        next(running)
    spoiled = bytearray(backup.read_bytes())
    spoiled[len(spoiled) // 2] ^= 1
    (tmp_path / "spoiled.tar").write_bytes(spoiled)
    made = impactd("restore", str(tmp_path / "spoiled.tar"), *where, str(tmp_path / "third"))
    assert made.returncode == 1
    assert "damaged" in made.stderr
    assert "Traceback" not in made.stderr
