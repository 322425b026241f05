"""SIGKILL of the daemon at random moments of drops and calibrations."""

from __future__ import annotations

import contextlib
import hashlib
import random
import sqlite3
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import httpx2
import pytest

from impactd.storage.shot_file import read_shot_file

from .daemon_process import DROP, ENDED, START_LIMIT_S, DaemonProcess, until

PLAN = [{"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.02, "repeats": 2}]
# From the request to well behind the end of the fit, at four times the pace of a real rig.
LONGEST_S = 1.2


@pytest.mark.parametrize(
    "moments",
    [
        2,
        pytest.param(30, marks=pytest.mark.slow),
        pytest.param(200, marks=[pytest.mark.slow, pytest.mark.soak]),
    ],
)
@pytest.mark.timeout(3600)
def test_nothing_is_lost_and_nothing_fires_twice(tmp_path: Path, moments: int) -> None:
    """Killed at any moment: no half file, what was told stored is there, nothing falls again."""
    with DaemonProcess(tmp_path) as daemon:
        rng = random.Random(20)
        told: set[int] = set()
        ready_s, killed_in = [daemon.start()], []
        for moment in range(moments):
            falls = daemon.falls()
            drops = _drops(daemon)
            calibrating = moment % 4 == 3
            path = "/v1/calibrations" if calibrating else "/v1/drops"
            body = {"plan": PLAN} if calibrating else DROP
            answer = daemon.post(path, body, key := f"moment-{moment}")
            assert answer.status_code == 202, answer.text
            told |= _watch_until(daemon, rng.uniform(0.0, LONGEST_S * (2 if calibrating else 1)))
            daemon.kill()

            killed_in.append(_last_state(daemon))
            if moment % 8 == 5:
                _lose_the_index(daemon, rng)
            _no_half_file(daemon.data)
            ready_s.append(daemon.start())

            fell = daemon.falls() - falls
            after = _drops(daemon)
            assert fell <= len(after) - len(drops), "a sphere fell without a row"
            assert all(drop["state"] in ENDED for drop in after.values())
            again = daemon.post(path, body, key)
            assert again.status_code == 202, again.text
            assert again.json()["number"] == answer.json()["number"]
            assert again.json()["state"] not in ("requested", "running")
            _stored_are_intact(daemon, told, after)
            assert daemon.falls() - falls == fell, "a sphere fell again after the restart"
            if moment % 20 == 19:
                print(_figures(moment + 1, killed_in, told, daemon, ready_s), flush=True)
        # A last drop shows that the sequence of numbers goes on and the rig works.
        highest = max(_drops(daemon), default=0)
        assert daemon.post("/v1/drops", DROP, "last").json()["number"] == highest + 1
        until(lambda: daemon.get("/v1/status")["jobs_waiting"], lambda waiting: waiting == 0)
        runs = daemon.get("/v1/calibrations?limit=200")["items"]
        assert {run["state"] for run in runs} <= {"done", "failed"}
        assert daemon.stop() == 0
        print(_figures(moments, killed_in, told, daemon, ready_s))


def _lose_the_index(daemon: DaemonProcess, rng: random.Random) -> None:
    """Delete the index, rebuild it, and kill the first rebuild at a random moment."""
    for path in daemon.data.glob("index.sqlite*"):
        path.unlink()
    reindex = [sys.executable, "-m", "impactd", "reindex", "--data", str(daemon.data), "--config"]
    began_s = time.monotonic()
    with subprocess.Popen([*reindex, str(daemon.config)], stdout=subprocess.DEVNULL) as first:
        while first.poll() is None and not list(daemon.data.glob("*.building")):
            assert time.monotonic() - began_s < START_LIMIT_S
        time.sleep(rng.uniform(0.0, 0.1))
        first.kill()
    done = subprocess.run(
        [*reindex, str(daemon.config)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Nothing was lost." in done.stdout


def _figures(
    moments: int, states: list[str], told: set[int], daemon: DaemonProcess, ready_s: list[float]
) -> str:
    again_s = sorted(ready_s[1:])
    return (
        f"{moments} kills while {_count(states)}; {len(told)} told stored, 0 lost; "
        f"{daemon.falls()} falls, 0 again; first start {ready_s[0]:.1f} s; ready again after "
        f"{again_s[0]:.1f} s at least, {again_s[len(again_s) // 2]:.1f} s (median), "
        f"{again_s[-1]:.1f} s at most, having computed for {daemon.start_cpu_s:.1f} s"
    )


def _watch_until(daemon: DaemonProcess, wait_s: float) -> set[int]:
    """Return the numbers of the shots that were told stored within a time."""
    ends_s, told = time.monotonic() + wait_s, set()
    while time.monotonic() < ends_s:
        with contextlib.suppress(httpx2.TransportError):
            for drop in daemon.get("/v1/drops?limit=3")["items"]:
                if drop["state"] in ("stored", "analysed"):
                    told.add(drop["number"])
        time.sleep(0.002)
    return told


def _drops(daemon: DaemonProcess) -> dict[int, dict[str, Any]]:
    found: dict[int, dict[str, Any]] = {}
    page = "/v1/drops?limit=200"
    while page:
        answer = daemon.get(page)
        found |= {drop["number"]: drop for drop in answer["items"]}
        page = answer["next"]
    return found


def _last_state(daemon: DaemonProcess) -> str:
    with contextlib.closing(sqlite3.connect(daemon.data / "index.sqlite")) as index:
        row = index.execute("SELECT state FROM drops ORDER BY number DESC LIMIT 1").fetchone()
    return str(row[0]) if row else "before the first row"


def _no_half_file(data: Path) -> None:
    for path in (data / "shots").glob("*.h5"):
        read_shot_file(path.read_bytes(), str(path))


def _stored_are_intact(
    daemon: DaemonProcess, told: set[int], drops: dict[int, dict[str, Any]]
) -> None:
    assert told <= {n for n, drop in drops.items() if drop["state"] in ("stored", "analysed")}
    for number in told:
        shot = daemon.get(f"/v1/shots/{number}")
        content = (daemon.data / f"shots/{number:06d}.h5").read_bytes()
        assert hashlib.sha256(content).hexdigest() == shot["sha256"]


def _count(states: list[str]) -> str:
    return ", ".join(f"{state} {states.count(state)}" for state in sorted(set(states)))
