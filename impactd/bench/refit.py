"""Re-fitting an archive: one worker, two workers, a Dask cluster of two, a kill in the middle.

The archive is made of simulated campaigns first; its shots are as long as the example campaigns'.
Every re-fit is a run of its own on the same shots, so that all do the same work.
"""

from __future__ import annotations

import argparse
import contextlib
import math
import os
import resource
import secrets
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd import blas_threads
from impactd.bench.figure import Figure
from impactd.bench.runner import show
from impactd.console.refit import executor_named
from impactd.jobs.orders import order_without_shots
from impactd.refit import RefitReport, refit, run_name
from impactd.settings.materials import load_materials
from impactd.settings.settings import Settings, find_config, load_settings
from impactd.storage.archive import Archive

SHOTS = 2000
QUICK_SHOTS = 432
SPEED_UP_GOAL = 1.7
MODELS = ("kv",)
CAMPAIGN_REPEATS = 8
ROUNDS = 2
POLL_S = 0.02


def measure() -> list[Figure]:
    """Run the benchmark on a small archive; `main` takes the full one.

    Returns
    -------
    list of Figure
        As `measure_refit` gives them.
    """
    with tempfile.TemporaryDirectory() as folder:
        return measure_refit(Path(folder), QUICK_SHOTS)


def measure_refit(folder: Path, shots: int, *, rounds: int = ROUNDS) -> list[Figure]:
    """Make an archive, re-fit it in every way, kill one re-fit half-way and go on.

    Parameters
    ----------
    folder : Path
        For the archive; a real disk, as every result is made durable.
    shots : int
        Size of the archive, rounded up to whole campaigns.
    rounds : int
        How often each way is timed; the least time counts.

    Returns
    -------
    list of Figure
        Rates, speed-ups, shots fitted twice or never, memory.
    """
    settings = load_settings(find_config("simulated.toml"), data=folder / "archive")
    with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
        make_archive(archive, folder, shots)
        ways = [(kind, workers) for kind in ("process", "dask") for workers in (1, 2)]
        best: dict[tuple[str, int], float] = {}
        kib = 0
        # round by round, so that a busier machine meets all of them; what disturbs only adds time
        for _ in range(rounds):
            for way in ways:
                report = _run(archive, settings, *way)
                best[way] = min(best.get(way, math.inf), report.duration_s)
                kib = kib or _peak_kib()
        done = report.fitted
        grown = 1024 * (_peak_kib() - kib) / ((rounds * len(ways) - 1) * done)
        return [
            _rate("one process", done, best["process", 1], None),
            _rate("two processes", done, best["process", 2], best["process", 1]),
            _rate("Dask, one worker", done, best["dask", 1], None),
            _rate("Dask, two workers", done, best["dask", 2], best["dask", 1]),
            _killed(archive, settings, done),
            Figure("memory that each further re-fit added, per shot", max(grown, 0.0), "B"),
        ]


def _rate(name: str, shots: int, duration_s: float, one_s: float | None) -> Figure:
    return Figure(
        name=f"re-fit of {shots} shots, {name}",
        value=shots / duration_s,
        unit="shots/s",
        reference=None if one_s is None else shots / one_s,
        reference_name="one worker",
        ratio=None if one_s is None else one_s / duration_s,
        goal="" if one_s is None else f">= {SPEED_UP_GOAL:g}",
        met=None if one_s is None else one_s / duration_s >= SPEED_UP_GOAL,
    )


def make_archive(archive: Archive, folder: Path, shots: int) -> None:
    """Import simulated campaigns until there are so many shots.

    Parameters
    ----------
    archive : Archive
        Open.
    shots : int
        At least so many.
    """
    made, seed = 0, 0
    while made < shots:
        with tempfile.TemporaryDirectory(dir=folder) as place:
            campaign = simulate_campaign(CampaignSettings(repeats=CAMPAIGN_REPEATS), seed)
            report = archive.import_campaign(write_campaign_folder(Path(place), campaign))
        made += len(report.numbers)
        seed += 1


def _run(
    archive: Archive, settings: Settings, kind: str, workers: int, label: str | None = None
) -> RefitReport:
    """Re-fit once; without a label as a run of its own."""
    materials = load_materials(settings.materials.file)
    with executor_named(kind, settings, workers=workers) as executor:
        return refit(
            archive,
            settings,
            materials,
            executor,
            models=MODELS,
            label=label or secrets.token_hex(8),
        )


def _killed(archive: Archive, settings: Settings, shots: int) -> Figure:
    """Kill the command when half of its fits are there, start again, and count what is there."""
    label = secrets.token_hex(8)
    order = order_without_shots(archive, settings, load_materials(settings.materials.file), MODELS)
    run = run_name(order, label)
    command = [sys.executable, "-m", "impactd", "refit", "--workers", "2", "--label", label]
    command += ["--model", MODELS[0], "--config", str(find_config("simulated.toml"))]
    command += ["--data", str(archive.directory)]
    process = subprocess.Popen(command, start_new_session=True)  # noqa: S603 - our own words
    try:
        while archive.fits.count_in_run(run) < shots // 2:
            if process.poll() is not None:
                raise RuntimeError("the re-fit that was to be killed ended by itself")
            time.sleep(POLL_S)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    resumed = _run(archive, settings, "process", 2, label)
    twice = archive.fits.rows_in_run(run) - archive.fits.count_in_run(run)
    wrong = twice + archive.fits.count_not_in_run(run)
    return Figure(
        name=f"killed after {resumed.before} of {shots} shots, started again: "
        "shots fitted twice or never",
        value=float(wrong),
        unit="1",
        goal="0",
        met=wrong == 0 and resumed.before + resumed.fitted == shots,
    )


def _peak_kib() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def main() -> int:
    """Run the benchmark from the command line: ``python -m impactd.bench.refit``."""
    blas_threads.keep_to_one()
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.refit")
    parser.add_argument("--shots", type=int, default=SHOTS)
    parser.add_argument("--folder", type=Path, help="where the archive is made; kept afterwards")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        figures = measure_refit(options.folder or Path(folder), options.shots)
    show({"refit": figures})
    return 0


if __name__ == "__main__":
    sys.exit(main())
