"""Aborts at random moments: after the answer nothing falls, however slow the disk is."""

from __future__ import annotations

import sqlite3
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from random import Random

import httpx2
import pytest

from ..storage.daemon_here import DaemonHere, daemon_here
from ..storage.daemon_process import DROP, until

PLAN = [{"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "repeats": 6}]
ENDED = ("done", "fitting", "failed")
LONGEST_LOCK_S = 0.5
QUICK: dict[str, dict[str, float]] = {
    "simulation": {"clock_speed": float("inf")},
    "trigger": {"record_s": 0.04},
    "preflight": {"baseline_samples": 20_000},
}
"""Short records: what is tested is when the valve opens."""


class Storm:
    """Work for the rig, and an abort in the middle of it, again and again."""

    def __init__(self, here: DaemonHere, seed: int) -> None:
        self.here = here
        self.random = Random(seed)
        self.stop = threading.Event()
        self.took_s: list[float] = []
        self.openings = 0
        self.late: list[str] = []
        for _ in range(2):  # the first one compiles and warms up
            began_s = time.monotonic()
            self._ended(f"/v1/drops/{self._post('/v1/drops', DROP).json()['number']}")
            # A calibration's six drops take about as long on this host, whatever else it does.
            self.latest_s = 6 * (time.monotonic() - began_s)
            until(lambda: here.daemon.service.wait_ready(1.0), bool)

    def drop(self) -> None:
        """Ask for one drop."""
        self._post("/v1/drops", DROP)

    def series(self) -> None:
        """Ask for a drop, wait for its end, ask for the next one, as a page does."""
        while not self.stop.is_set():
            answer = self._post("/v1/drops", DROP)
            if answer.status_code == 202:
                self._ended(f"/v1/drops/{answer.json()['number']}")
            else:
                time.sleep(0.01)

    def calibration(self) -> None:
        """Ask for a calibration of six drops and wait until it makes no more."""
        answer = self._post("/v1/calibrations", {"plan": PLAN})
        if answer.status_code == 202:
            path = f"/v1/calibrations/{answer.json()['number']}"
            until(lambda: self.here.get(path), lambda run: run["state"] in ENDED)

    def _post(self, path: str, body: dict[str, object]) -> httpx2.Response:
        key = {"Idempotency-Key": str(uuid.uuid4())}
        return self.here.client.post(path, json=body, headers=key)

    def _ended(self, path: str) -> None:
        final = ("stored", "analysed", "failed", "aborted", "interrupted")
        until(lambda: self.here.get(path), lambda drop: drop["state"] in final)

    def blow(self, work: Callable[[], None], *, slow_disk: bool) -> None:
        """Begin some work, abort it at a random moment, and look into the rig's own log."""
        openings = self.here.world.openings_ns
        before = len(openings)
        self.stop.clear()
        thread = threading.Thread(target=work)
        thread.start()
        locker = threading.Thread(target=self._lock_index) if slow_disk else None
        if locker is not None:
            locker.start()
        time.sleep(self.random.uniform(0.0, self.latest_s))
        self.stop.set()
        began_s = time.monotonic()
        answer = self.here.client.post("/v1/abort").json()
        answered_ns = time.monotonic_ns()
        self.took_s.append(time.monotonic() - began_s)
        assert "NOT MADE SAFE" not in answer["sentence"], answer
        thread.join()
        if locker is not None:
            locker.join()
        loop = self.here.daemon.service._loop
        until(lambda: loop.run is None and not self.here.daemon.calibrations.running(), bool)
        late = [ns for ns in openings[before:] if ns > answered_ns]
        self.late += [
            f"{work.__name__}: opened {(ns - answered_ns) * 1e-6:.0f} ms after {answer['sentence']}"
            for ns in late
        ]
        self.openings += len(openings) - before
        assert self.here.world._vacuum_on
        until(lambda: self.here.daemon.service.wait_ready(1.0), bool)

    def _lock_index(self) -> None:
        path = self.here.daemon.archive.directory / "index.sqlite"
        with closing(sqlite3.connect(path, isolation_level=None, timeout=30)) as other:
            while not self.stop.is_set():
                other.execute("BEGIN IMMEDIATE")
                time.sleep(self.random.uniform(0.0, LONGEST_LOCK_S))
                other.execute("ROLLBACK")
                time.sleep(self.random.uniform(0.0, 0.05))


def _storm(data: Path, aborts: int) -> None:
    with daemon_here(data, **QUICK) as here:
        here.daemon.jobs.stop()  # fits need not run beside: they would take most of the time
        storm = Storm(here, aborts)
        for number in range(aborts):
            work = (storm.calibration, storm.series, storm.drop)[number % 3]
            storm.blow(work, slow_disk=number % 2 == 1)
        quickest, middle = min(storm.took_s), sorted(storm.took_s)[aborts // 2]
        print(
            f"{aborts} aborts: {storm.openings} openings of the valve, {len(storm.late)} after an "
            f"answer; answered after {middle * 1e3:.0f} ms (median), {quickest * 1e3:.0f} ms at "
            f"least, {max(storm.took_s) * 1e3:.0f} ms at most"
        )
        assert not storm.late
        assert storm.openings


def test_nothing_falls_after_an_answered_abort(tmp_path: Path) -> None:
    """Twelve aborts of calibrations, series and drops, half of them with a slow disk."""
    _storm(tmp_path / "data", 12)


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("aborts", [100, pytest.param(1000, marks=pytest.mark.soak)])
def test_nothing_falls_after_many_answered_aborts(tmp_path: Path, aborts: int) -> None:
    """The same, a hundred and a thousand times."""
    _storm(tmp_path / "data", aborts)
