"""Thousands of drops in one process: memory, descriptors, threads, and the time to store."""

from __future__ import annotations

import ctypes
import gc
import os
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from impactd.acquisition.service import AcquisitionService
from impactd.events import EventBus
from impactd.rig.build import build_rig
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config, load_settings
from impactd.storage.archive import Archive, DropRequest

REQUEST = DropRequest("acetal", "aluminium", 0.01, "ab")
FASTER = {
    "simulation": {"clock_speed": 10.0},
    "trigger": {"record_s": 0.03},
    "timeouts": {"held_stable_s": 0.001, "impact_margin_s": 20.0},
    "preflight": {"baseline_samples": 20_000},
    "storage": {"reserve_bytes": 0},
}


M_MMAP_THRESHOLD = -3
"""From <malloc.h>."""
LOOKS = 20
"""In two seconds: an armed rig looks at its quiet line several times in that."""
LONG = 10_000
"""Drops that take hours, and tell how they fare."""


@dataclass
class Held:
    """What the process holds at a moment."""

    memory_bytes: int
    descriptors: int
    threads: int

    @classmethod
    def at_rest(cls) -> Held:
        """Return the least of each over a while: what is armed comes and goes, what leaks stays."""
        seen = []
        for _ in range(LOOKS):
            seen.append(cls.now())
            time.sleep(0.1)
        return cls(
            min(one.memory_bytes for one in seen),
            min(one.descriptors for one in seen),
            min(one.threads for one in seen),
        )

    @classmethod
    def now(cls) -> Held:
        """Look."""
        gc.collect()
        # what was freed goes back: else the heap's arenas move the figure by a tenth
        ctypes.CDLL(None).malloc_trim(0)
        return cls(
            _own_bytes(),
            len(os.listdir("/proc/self/fd")),
            threading.active_count(),
        )


def _own_bytes() -> int:
    """Return what the process has written to and not given back, in memory or swapped out.

    Pages of files are not counted: the kernel takes them away and reads them again as it likes.
    """
    lines = Path("/proc/self/smaps_rollup").read_text().splitlines()
    held = {line.split(":")[0]: line.split()[-2] for line in lines if line.endswith(" kB")}
    return 1024 * (int(held["Anonymous"]) + int(held["Swap"]))


@pytest.mark.parametrize(
    "drops",
    [
        pytest.param(100, marks=pytest.mark.slow),
        pytest.param(500, marks=pytest.mark.slow),
        pytest.param(10_000, marks=[pytest.mark.slow, pytest.mark.soak]),
    ],
)
@pytest.mark.timeout(7200)
def test_drops_leave_nothing_behind_but_their_shots(tmp_path: Path, drops: int) -> None:
    """From the first tenth to the end: 5 % more memory at most, no descriptor, no thread."""
    # arrays of any size go back at once, so that what is held is what somebody holds: by default
    # the heap keeps room for the largest array it ever freed
    ctypes.CDLL(None).mallopt(M_MMAP_THRESHOLD, 128 * 1024)
    settings = load_settings(find_config("simulated.toml"), data=tmp_path)
    settings = settings.model_copy(
        update={n: getattr(settings, n).model_copy(update=keys) for n, keys in FASTER.items()}
    )
    materials = load_materials(settings.materials.file)
    archive = Archive.open(tmp_path, reserve_bytes=0)
    rig = build_rig(settings, materials)
    told: list[float] = []
    bus = EventBus(archive.events)

    def publish(kind: str, data: dict[str, object]) -> None:
        bus.publish(kind, data)
        if kind == "drop.stored":
            told.append(float(str(data["record_to_stored_s"])))

    service = AcquisitionService(rig, archive, settings, materials, publish)
    service.start()
    try:
        assert service.wait_ready(60.0), service.status().sentence
        first, failed = None, 0
        for done in range(1, drops + 1):
            drop = service.request_drop(REQUEST, owner="ab", idempotency_key=f"k{done}")
            drop = service.wait(drop.number, 60.0)
            # So fast a clock leaves a busy host behind now and then; what fails is counted.
            failed += drop.state != "stored"
            assert service.wait_ready(60.0)
            if done == drops // 10:
                first = Held.at_rest()
            if drops >= LONG and done % (drops // 100) == 0:
                held, p99_ms = Held.now(), _p99_ms(told, len(told), drops)
                print(
                    f"{done} drops, {failed} failed: {held}, store p99 {p99_ms:.1f} ms", flush=True
                )
        last = _at_rest(first)
    finally:
        service.stop()
        rig.close()
        archive.close()
    assert first is not None
    grown = last.memory_bytes / first.memory_bytes - 1
    print(
        f"{drops} drops, {failed} failed: memory {first.memory_bytes / 1e6:.0f} MB, "
        f"{100 * grown:+.1f} %; "
        f"descriptors {last.descriptors - first.descriptors:+d}, threads "
        f"{last.threads - first.threads:+d}; store p99 {_p99_ms(told, drops // 10, drops):.1f} ms "
        f"at first, {_p99_ms(told, len(told), drops):.1f} ms at last"
    )
    assert failed <= drops // 10
    assert grown <= 0.05
    assert last.descriptors <= first.descriptors
    assert last.threads <= first.threads


def _at_rest(first: Held | None) -> Held:
    """Return what is held once threads on their way out have gone; a leaked one never goes."""
    deadline = time.monotonic() + 5.0
    held = Held.at_rest()
    while first is not None and held.threads > first.threads and time.monotonic() < deadline:
        time.sleep(0.05)
        held = Held.at_rest()
    return held


def _p99_ms(told: list[float], done: int, drops: int) -> float:
    last = told[max(done - drops // 10, 0) : done]
    return 1e3 * float(np.percentile(last, 99)) if last else float("nan")
