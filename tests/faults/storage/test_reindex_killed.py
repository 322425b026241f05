"""A rebuild of the index that is ended half-way: by a kill, or by a power cut."""

from __future__ import annotations

import multiprocessing
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from impactd.storage.archive import Archive

from .power_cut import Disk, calls, settled, strace
from .rich_archive import check, make, rows

STEPS = ("open", "link", "rename", "unlink", "fsync", "write")
REINDEX = (
    "import pathlib, sys; from impactd.storage.archive import Archive\n"
    "Archive.reindex(pathlib.Path(sys.argv[1]))\n"
)
# of a process without threads: a lock that a thread of the tests' own held would never be let go
_forked = multiprocessing.get_context("forkserver")
_forked.set_forkserver_preload([__name__])


@pytest.fixture(params=["deleted index", "both there", "no journal"])
def sound(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, dict[str, Any]]:
    """Return the folder of a closed archive that is to be rebuilt, and its rows."""
    folder = tmp_path / "sound"
    make(folder)
    truth = rows(folder)
    if request.param == "deleted index":
        (folder / "index.sqlite").unlink()
    elif request.param == "no journal":
        (folder / "journal.jsonl").unlink()
    return folder, truth


def _reindex_until(folder: Path, last: int) -> None:
    """Rebuild, and end like a killed process before the system call of that number."""
    done = 0

    def counted(call: Callable[..., Any]) -> Callable[..., Any]:
        """Return a system call that is counted."""

        def made(*arguments: Any, **named: Any) -> Any:
            """End, or do it."""
            nonlocal done
            done += 1
            if done > last:
                os._exit(9)
            return call(*arguments, **named)

        return made

    for name in STEPS:
        setattr(os, name, counted(getattr(os, name)))
    Archive.reindex(folder)
    os._exit(0)


def _copied(sound: Path, folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    return shutil.copytree(sound, folder)


@pytest.mark.slow
def test_killed_at_every_step(sound: tuple[Path, dict[str, Any]], tmp_path: Path) -> None:
    """Before each file that it opens, writes, syncs, names or removes: nothing is lost."""
    folder, truth = sound
    step, code, refused = 0, 9, 0
    while code == 9:
        here = _copied(folder, tmp_path / "killed")
        process = _forked.Process(target=_reindex_until, args=(here, step))
        process.start()
        process.join()
        code = process.exitcode
        refused += not check(here, truth)
        step += 1
    assert code == 0
    print(f"killed before each of {step - 1} system calls: 0 rows lost, {refused} starts refused")


@pytest.mark.parametrize("kills", [7, pytest.param(70, marks=pytest.mark.slow)])
@pytest.mark.timeout(1800)
def test_killed_at_random_moments(
    sound: tuple[Path, dict[str, Any]], tmp_path: Path, kills: int
) -> None:
    """SIGKILL at any moment: the archive is whole, or refused until it was rebuilt."""
    folder, truth = sound
    rng = random.Random(24)
    began_s = time.monotonic()
    Archive.reindex(_copied(folder, tmp_path / "killed"))
    takes_s = time.monotonic() - began_s
    ended, refused = 0, 0
    for _ in range(kills):
        here = _copied(folder, tmp_path / "killed")
        process = _forked.Process(target=Archive.reindex, args=(here,))
        process.start()
        time.sleep(rng.uniform(0.0, takes_s))
        process.kill()
        process.join()
        ended += process.exitcode == 0
        refused += not check(here, truth)
    print(f"{kills} kills, {ended} behind its end: 0 rows lost, {refused} starts refused")


@pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace (apt install strace)")
@pytest.mark.parametrize(
    "points",
    [
        4,
        pytest.param(100, marks=pytest.mark.slow),
        pytest.param(1000, marks=[pytest.mark.slow, pytest.mark.soak]),
    ],
)
@pytest.mark.timeout(1800)
def test_a_power_cut_during_a_rebuild(
    sound: tuple[Path, dict[str, Any]], tmp_path: Path, points: int
) -> None:
    """At each point, nothing unsynced or any part of it kept: nothing is lost."""
    folder, truth = sound
    trace = tmp_path / "trace"
    disk = Disk(folder)
    subprocess.run([*strace(trace), sys.executable, "-c", REINDEX, folder], check=True)
    played = [call for call in calls(settled(trace)) if call.name != "sendto"]
    here = [place for place, call in enumerate(played) if disk.root in _names(call)]
    rng = random.Random(25)
    # The last ones are the swap: each of them is looked at.
    chosen = {*rng.sample(here, min(points, len(here))), *here[-12:]}
    refused = 0
    for place, call in enumerate(played):
        disk.play(call)
        for torn in (None, rng) if place in chosen else ():
            cut = tmp_path / "cut"
            shutil.rmtree(cut, ignore_errors=True)
            disk.after_power_cut(cut, torn)
            refused += not check(cut, truth)
    print(f"power cut after {len(chosen)} of {len(here)} changes, twice each: {refused} refused")


def _names(call: Any) -> str:
    return " ".join((call.file, *(text.decode(errors="replace") for text in call.texts[:2])))
