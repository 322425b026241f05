"""The disk answers a sync with EIO: once, or from then on."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from impactd.storage.archive import Archive

from .power_cut import Disk, calls, strace

SHOTS = 2
PROCESS = Path(__file__).parent / "storing_process.py"


@pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace (apt install strace)")
@pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.timeout(900)
def test_what_was_not_synced_is_never_acknowledged(tmp_path: Path, every: int) -> None:
    """Each sync of two shots fails, once and for good: told shots survive a power cut then."""
    syncs = _syncs(tmp_path)
    counts = {"runs": 0, "told": 0, "alarms": 0, "kept in memory and stored": 0}
    for first in range(1, syncs + 1, every):
        for last in ("", "+"):
            said = _lost_after(tmp_path, f"{first}{last}")
            counts["runs"] += 1
            counts["told"] += len(re.findall("told", said))
            counts["alarms"] += "alarm" in said
            counts["kept in memory and stored"] += bool(
                re.search(r"kept (\d+)(.*\n)+told \1", said)
            )
            if not last:
                assert said.count("told") == SHOTS or "alarm" in said, said
            assert said.count("told") == SHOTS or "alarm" in said, said
    print(f"EIO at each of {syncs} syncs, every {every}: {counts}, 0 acknowledged and lost")


def _syncs(tmp_path: Path) -> int:
    trace = tmp_path / "trace"
    _run(tmp_path / "count", strace(trace))
    return sum(call.name in ("fsync", "fdatasync") for call in calls(trace))


def _lost_after(tmp_path: Path, when: str) -> str:
    """Let the syncs of a run fail, cut the power at its end; return what the process said."""
    folder, trace = tmp_path / f"run-{when}", tmp_path / "trace"
    Archive.open(folder, reserve_bytes=0).close()
    disk = Disk(folder)
    inject = ("-e", f"inject=fsync,fdatasync:error=EIO:when={when}")
    done = _run(folder, strace(trace, *inject))
    assert done.returncode == 0, done.stderr
    for call in calls(trace):
        disk.play(call)
    cut = tmp_path / f"cut-{when}"
    disk.after_power_cut(cut, None)
    with Archive.open(cut, reserve_bytes=0) as archive:
        archive.interrupt_unfinished()
        for number in re.findall(r"told (\d+)", done.stdout):
            assert archive.drop(int(number)).state == "stored", (when, done.stdout)
            archive.read_shot(int(number))
        problems = [one for one in archive.verify() if one.problem]
        assert problems == [], (when, done.stdout)
    shutil.rmtree(folder)
    shutil.rmtree(cut)
    return done.stdout


def _run(folder: Path, before: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*before, sys.executable, str(PROCESS), str(folder), str(SHOTS)],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
