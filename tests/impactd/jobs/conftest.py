"""A job runner on a real archive, with the settings of the simulated rig."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.digitizer import Record
from impactd.jobs.runner import JobRunner
from impactd.settings.materials import Materials, load_materials
from impactd.settings.settings import Settings, find_config, load_settings
from impactd.storage.archive import Archive, DropRequest, Job, ShotMetadata
from impactd.storage.timestamp import utc_now

HERE = Path(__file__).parent
LIVELINESS_S = 120.0


@pytest.fixture
def settings(tmp_path: Path) -> Settings:
    """Return the simulated rig's settings with tight limits."""
    loaded = load_settings(find_config("simulated.toml"), data=tmp_path / "archive")
    jobs = loaded.jobs.model_copy(
        update={"fit_time_limit_s": 3.0, "fit_memory_bytes": 300_000_000, "workers": 1}
    )
    return loaded.model_copy(update={"jobs": jobs})


@pytest.fixture
def materials(settings: Settings) -> Materials:
    """Return the materials that came with the program."""
    return load_materials(settings.materials.file)


@pytest.fixture
def archive(settings: Settings) -> Iterator[Archive]:
    """Return an open, empty archive."""
    with Archive.open(settings.storage.directory, reserve_bytes=0) as opened:
        yield opened


@dataclass
class Bench:
    """A runner with its events, and what tests do with it."""

    archive: Archive
    settings: Settings
    materials: Materials
    events: list[tuple[str, dict[str, Any]]] = field(default_factory=list)

    def runner(self, **options: Any) -> JobRunner:
        """Return a runner that tells its events here."""
        return JobRunner(
            self.archive,
            self.settings,
            lambda kind, data: self.events.append((kind, data)),
            materials=self.materials,
            **options,
        )

    def kinds(self, expected: int) -> list[str]:
        """Return what happened, progress left out, once so many events are there."""
        deadline = time.monotonic() + LIVELINESS_S
        while True:
            kinds = [kind for kind, _ in self.events if kind != "job.progress"]
            if len(kinds) >= expected or time.monotonic() > deadline:
                return kinds
            time.sleep(0.01)

    def wait(self, number: int) -> Job:
        """Return a job once it ended."""
        deadline = time.monotonic() + LIVELINESS_S
        while (job := self.archive.jobs.get(number)).state in ("queued", "running"):
            assert time.monotonic() < deadline, job
            time.sleep(0.01)
        return job

    def store(self, sphere: str = "acetal", surface: str = "polycarbonate", **begin: Any) -> int:
        """Store a shot that looks like an impact, bounce included; return its number."""
        generator = np.random.default_rng(1)
        codes = generator.normal(0.0, 5.0, 160_000)
        for at, height in ((20_000, 8000.0), (20_000 + 130_000, 4500.0)):
            codes[at : at + 100] += height * np.sin(np.linspace(0.0, np.pi, 100))
        record = Record(codes.astype(np.int16), 3e-4, 0.0, True, 1e6, 1.0, 10.0, 20_010, 0, 0)
        request = DropRequest(sphere, surface, 0.047, "ab")
        drop, _ = self.archive.begin_drop(request, owner="anna", **begin)
        metadata = ShotMetadata(
            utc_now(),
            0,
            self.settings.release.gravity_m_per_s2,
            sphere=self.materials.spheres[sphere],
            surface=self.materials.surfaces[surface],
            drop_height_m=0.047,
            speed_repeatability=0.003,
        )
        return self.archive.store_shot(drop.number, record, metadata).number


@pytest.fixture
def bench(archive: Archive, settings: Settings, materials: Materials) -> Bench:
    """Return a bench."""
    return Bench(archive, settings, materials)


@pytest.fixture
def running() -> Iterator[Callable[[JobRunner], JobRunner]]:
    """Return a function that starts a runner which is stopped at the end of the test."""
    started: list[JobRunner] = []

    def start(runner: JobRunner) -> JobRunner:
        started.append(runner)
        runner.start()
        return runner

    yield start
    for runner in started:
        runner.stop()
