"""Fits that crash, hang and eat memory beside one that is well, in a daemon that goes on."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from impactd.daemon import Daemon

from .daemon_here import DaemonHere, daemon_here
from .daemon_process import ENDED, until

HERE = Path(__file__).parent


def _load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("bad_fits", HERE / "bad_fits.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _with_bad_fits(daemon: Daemon) -> None:
    daemon.jobs._tasks = {**daemon.jobs._tasks, "fit_shot": _load().fit_shot}
    daemon.jobs._import_paths = [HERE]


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_a_bad_fit_harms_nobody_else(tmp_path: Path) -> None:
    """One retry, then failed with the reason; the next fit is done, and the status answers."""
    limits = {"fit_time_limit_s": 20.0, "fit_memory_bytes": 1_000_000_000, "workers": 1}
    with daemon_here(tmp_path / "data", before=_with_bad_fits, jobs=limits) as here:
        calm = _latencies_ms(here, lambda: False, at_least=100)
        for number in range(1, 5):
            assert here.drop(f"drop-{number}").json()["number"] == number
            until(lambda n=number: here.get(f"/v1/drops/{n}")["state"], ENDED.__contains__)
            here.ready()
        archive = here.daemon.archive
        busy = _latencies_ms(here, lambda: archive.jobs.waiting() > 0, at_least=100)
        jobs = {job.payload["shot"]: job for job in archive.jobs.list(kind="fit_shot")}
        reasons = {}
        for number in (1, 2, 3):
            assert (jobs[number].state, jobs[number].attempts) == ("failed", 2)
            drop = here.get(f"/v1/drops/{number}")
            assert drop["state"] == "stored"
            assert drop["problem"]["detail"] == jobs[number].reason
            assert drop["problem"]["remedy"]
            reasons[number] = jobs[number].reason
        assert "20 s" in str(reasons[2])
        assert "memory" in str(reasons[3])
        assert (jobs[4].state, jobs[4].attempts) == ("done", 1)
        assert here.get("/v1/drops/4")["state"] == "analysed"
        assert all(here.daemon.liveness().values())
    print(
        f"3 bad fits: 2 attempts each, then failed ({'; '.join(map(str, reasons.values()))}); "
        f"status p99 {np.percentile(calm, 99):.1f} ms before, {np.percentile(busy, 99):.1f} ms "
        f"meanwhile ({len(busy)} requests)"
    )


def _latencies_ms(here: DaemonHere, goes_on: Callable[[], bool], *, at_least: int) -> list[float]:
    took: list[float] = []
    while len(took) < at_least or goes_on():
        began_s = time.perf_counter()
        here.get("/v1/status")
        took.append(1e3 * (time.perf_counter() - began_s))
        time.sleep(0.02)
    return took
