"""How long from a shot's last sample to a file that would survive a power cut."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import numpy as np

from analysis.campaign import Quantity, Sphere, Surface
from drivers.digitizer import Record
from impactd.bench.figure import Figure
from impactd.storage.archive import Archive, DropRequest, ShotMetadata
from impactd.storage.timestamp import utc_now
from impactd.storage.version import software

SHOTS = 100
RATE_HZ = 1e6
SAMPLES = 400_000
TRIGGER_INDEX = 20_000
GOAL_MEDIAN_MS = 50.0


def measure_store(shots: int = SHOTS, *, directory: Path | None = None) -> dict[str, float]:
    """Store so many records of 0.4 s at 1 MHz and time each.

    The clock runs from the record in memory to the return of ``store_shot``: file built, written,
    fsync of file and directory, index committed. Every read-back is compared.

    Parameters
    ----------
    directory : Path, optional
        Where; without it in the working directory, since a temporary one may be no disk at all.

    Returns
    -------
    dict
        ``median_ms``, ``p99_ms``, ``largest_ms`` [ms], ``file_bytes`` [B] and ``shots``.
    """
    with tempfile.TemporaryDirectory(dir=directory or Path.cwd(), prefix="bench-store-") as place:
        times_s, size = _store(Path(place), shots)
    return {
        "shots": float(shots),
        "median_ms": 1e3 * float(np.median(times_s)),
        "p99_ms": 1e3 * float(np.quantile(times_s, 0.99)),
        "largest_ms": 1e3 * max(times_s),
        "file_bytes": float(size),
    }


def measure() -> list[Figure]:
    """Return the figures of this benchmark."""
    found = measure_store()
    median, p99 = found["median_ms"], found["p99_ms"]
    name = f"last sample to durable file, {SHOTS} shots of 0.4 s"
    goal = f"<= {GOAL_MEDIAN_MS:g} ms"
    return [
        Figure(f"{name}: median", median, "ms", goal=goal, met=median <= GOAL_MEDIAN_MS),
        Figure(f"{name}: p99", p99, "ms"),
    ]


def _store(directory: Path, shots: int) -> tuple[list[float], int]:
    generator = np.random.default_rng(0)
    request = DropRequest("acetal", "polycarbonate", 0.047, "bench")
    times_s: list[float] = []
    with Archive.open(directory, reserve_bytes=0) as archive:
        for _ in range(shots):
            record = _record(generator)
            drop, _ = archive.begin_drop(request, owner="bench")
            metadata = _metadata()
            started = time.perf_counter()
            shot = archive.store_shot(drop.number, record, metadata)
            times_s.append(time.perf_counter() - started)
            if not np.array_equal(archive.read_shot(shot.number).recording.samples, record.codes):
                raise RuntimeError(f"Shot {shot.number} reads back differently.")
    return times_s, shot.size_bytes


def _record(generator: np.random.Generator) -> Record:
    codes = generator.normal(0.0, 5.0, SAMPLES)
    codes[TRIGGER_INDEX : TRIGGER_INDEX + 100] += 8000.0 * np.sin(np.linspace(0.0, np.pi, 100))
    return Record(
        codes=codes.astype(np.int16),
        volts_per_code=3.0517578125e-4,
        offset_v=0.0,
        calibrated=True,
        sample_rate_hz=RATE_HZ,
        sample_rate_u_hz=10.0,
        range_v=10.0,
        trigger_index=TRIGGER_INDEX,
        first_sample_index=0,
        trigger_monotonic_ns=time.monotonic_ns(),
        status_words=(0x000A, 0x000A),
        samples_streamed=SAMPLES,
    )


def _metadata() -> ShotMetadata:
    return ShotMetadata(
        started_utc=utc_now(),
        started_monotonic_ns=time.monotonic_ns(),
        gravity_m_per_s2=9.80665,
        operator="bench",
        sphere=Sphere("acetal", 4.76e-3, 0.6116e-3, Quantity(3.15e9, 6e7), Quantity(0.35, 0.01)),
        surface=Surface("polycarbonate", Quantity(2.2e9, 5e7), Quantity(0.37, 0.01), 3.6e-3),
        drop_height_m=0.047,
        software=software(),
    )
