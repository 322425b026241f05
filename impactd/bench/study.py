"""A large re-fit on a Dask cluster: cost by shot over the size, and what is killed on the way.

The archive is one simulated campaign, copied under as many numbers as are asked for; the files are
hard links. Scheduler and workers are programs of their own (`cluster`). Cost is processor time, of
all of them and of this process, so that other work on the machine hardly counts. In one more re-fit
of everything a worker is killed after a quarter of the shots and the scheduler after half.

``--instant N`` asks how the process that hands out and writes bears 100 000 shots, in a minute or
two: its worker answers at once, with results of other shots.
"""

from __future__ import annotations

import argparse
import dataclasses
import math
import os
import secrets
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from analysis.aliases import Array
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd import blas_threads
from impactd.aliases import Json
from impactd.bench.cluster import SCHEDULER, Cluster
from impactd.bench.figure import Figure
from impactd.bench.runner import show
from impactd.jobs.executors import TaskExecutor, dask_executor
from impactd.jobs.orders import order_without_shots, shot_places
from impactd.jobs.refit_task import fit_chunk
from impactd.refit import RefitReport, refit
from impactd.settings.materials import load_materials
from impactd.settings.settings import Settings, find_config, load_settings
from impactd.storage.archive import INDEX_NAME, Archive
from impactd.storage.index import Index
from impactd.storage.numbers import NumberSequence
from impactd.storage.shots import ShotTable

CAMPAIGN = 54
"""Drops of a simulated campaign; sizes are multiples, so that all have the same mixture."""
SIZES = (2 * CAMPAIGN, 20 * CAMPAIGN, 200 * CAMPAIGN)
WORKERS = 2
"""The fewest of which one can be killed; as many as this machine has cores."""
MODELS = ("kv",)
LEAST_SHOTS = 20 * CAMPAIGN
"""What a smaller archive is fitted again and again for: one round of it is two seconds."""
GROWTH_GOAL = 1.10
"""Processor time by shot of the largest over the smallest archive: a tenth is called flat."""
MEMORY_GOAL_BYTES = 20e6
"""Far below the results of a large study, far above what an allocator rounds up."""
WORKERS_WITHIN_S = 120.0
"""A first start compiles the solver, a minute on a slow machine."""
_POLL_S = 0.1


@dataclass
class Watched:
    """A re-fit, and what was seen on the way.

    Attributes
    ----------
    grown_bytes : int
        By which the memory of this process grew after a quarter of the shots.
    """

    report: RefitReport
    grown_bytes: int


def measure() -> list[Figure]:
    """Run the study in full size.

    Returns
    -------
    list of Figure
        As `measure_study` gives them.
    """
    with tempfile.TemporaryDirectory() as folder:
        return measure_study(Path(folder), SIZES)


def measure_study(folder: Path, sizes: Sequence[int], *, workers: int = WORKERS) -> list[Figure]:
    """Re-fit a growing archive, the largest once more with a worker and the scheduler killed.

    Parameters
    ----------
    folder : Path
        For the archive and the logs of the cluster; a real disk, as every result is made durable.
    sizes : sequence of int
        Shots, multiples of `CAMPAIGN`, rising.

    Returns
    -------
    list of Figure
        Cost by shot, throughput, memory, size of the results, shots fitted twice or never.
    """
    settings = load_settings(find_config("simulated.toml"), data=folder / "archive")
    figures: list[Figure] = []
    costs: dict[int, float] = {}
    with Cluster(folder, workers) as cluster, dask_executor(scheduler=cluster.address) as executor:
        wait_for_workers(executor, workers)
        for size in sizes:
            copy_campaign(settings, size)
            with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
                if not costs:
                    watched(archive, settings, executor)  # compiles
                rounds = math.ceil(LEAST_SHOTS / size)
                bytes_before, before = _index_bytes(settings), _clocks(cluster)
                for _ in range(rounds):
                    seen = watched(archive, settings, executor)
                fitted = rounds * size
                wall_s, own_s, cluster_s = (_clocks(cluster) - before) / fitted
                index_bytes = (_index_bytes(settings) - bytes_before) / fitted
            costs[size] = own_s + cluster_s
            figures.append(Figure(f"{size} shots, processor time by shot", costs[size], "s"))
        figures += [
            _growth("processor time by shot", costs),
            Figure("of it in the process that hands out and writes", own_s, "s"),
            Figure("throughput per worker", 1 / (wall_s * workers), "shots/s"),
            Figure("index, per fit", index_bytes, "B"),
            _memory(seen),
        ]
        with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
            figures += interrupted(archive, settings, cluster, executor)
    return figures


class InstantExecutor(TaskExecutor):
    """A worker that answers at once with the results of the first shots.

    Parameters
    ----------
    answers : list of dict
        What `fit_chunk` gave for `CAMPAIGN` shots.
    """

    workers = WORKERS

    def __init__(self, answers: list[Json]) -> None:
        self._answers = answers

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Answer an order of `fit_chunk`."""
        del fn, kwargs
        (order,) = args
        future: Future[Any] = Future()
        numbers = [one["number"] for one in order["shots"]]
        future.set_result([
            {**self._answers[(number - 1) % CAMPAIGN], "shot": number} for number in numbers
        ])  # fmt: skip
        return future


def measure_instant(folder: Path, shots: int) -> list[Figure]:
    """Hand out and write a tenth of the shots, then all, with a worker that answers at once.

    Parameters
    ----------
    folder : Path
        For the archive.

    Returns
    -------
    list of Figure
        Processor time by shot, its growth, memory.
    """
    settings = load_settings(find_config("simulated.toml"), data=folder / "archive")
    materials, costs = load_materials(settings.materials.file), {}
    copy_campaign(settings, CAMPAIGN)
    with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
        order = order_without_shots(archive, settings, materials, MODELS)
        places = shot_places(archive, range(1, CAMPAIGN + 1))
        executor = InstantExecutor(fit_chunk({**order, "shots": places}))
    sizes = [CAMPAIGN * math.ceil(share * shots / CAMPAIGN) for share in (0.1, 1.0)]
    for size in sizes:
        copy_campaign(settings, size)
        with Archive.open(settings.storage.directory, reserve_bytes=0) as archive:
            began_s = time.process_time()
            seen = watched(archive, settings, executor)
            costs[size] = (time.process_time() - began_s) / size
    named = "handed out and written, processor time by shot"
    return [
        *(Figure(f"{size} shots {named}", cost, "s") for size, cost in costs.items()),
        _growth(named, costs),
        _memory(seen),
    ]


def _growth(named: str, costs: dict[int, float]) -> Figure:
    """Return how the cost by shot grows from the smallest to the largest archive."""
    least, most = min(costs), max(costs)
    growth = costs[most] / costs[least]
    return Figure(
        name=f"{named}, {most} shots over {least}",
        value=growth,
        unit="1",
        goal=f"<= {GROWTH_GOAL:g}",
        met=growth <= GROWTH_GOAL,
    )


def interrupted(
    archive: Archive, settings: Settings, cluster: Cluster, executor: TaskExecutor
) -> list[Figure]:
    """Re-fit everything while a worker and then the scheduler are killed.

    Returns
    -------
    list of Figure
        Shots fitted twice or never, and memory.
    """
    victims = iter([(0.25, "worker-1"), (0.5, SCHEDULER), (2.0, "")])
    share, name = next(victims)

    def kill(done: int, total: int) -> None:
        """Kill the next one when it is time."""
        nonlocal share, name
        if done >= share * total:
            cluster.kill(name)
            share, name = next(victims)

    seen = watched(archive, settings, executor, kill)
    run, shots = seen.report.run, archive.fits.count_not_in_run("")  # of no run: all
    twice = archive.fits.rows_in_run(run) - archive.fits.count_in_run(run)
    wrong = twice + archive.fits.count_not_in_run(run) + abs(seen.report.fitted - shots)
    return [
        Figure(
            name=f"{shots} shots, a worker and the scheduler killed: fitted twice or never",
            value=float(wrong),
            unit="1",
            goal="0",
            met=wrong == 0 and not seen.report.failed,
        ),
        _memory(seen),
    ]


def watched(
    archive: Archive,
    settings: Settings,
    executor: TaskExecutor,
    tell: Callable[[int, int], None] = lambda done, total: None,
    *,
    label: str | None = None,
) -> Watched:
    """Re-fit an archive and look at the memory of this process.

    Parameters
    ----------
    tell : callable, optional
        Hears shots done and shots in all.
    label : str, optional
        Without one it is a run of its own.
    """
    process, at_quarter = psutil.Process(), 0

    def look(done: int, total: int) -> None:
        """Note the memory at a quarter."""
        nonlocal at_quarter
        if not at_quarter and 4 * done >= total:
            at_quarter = process.memory_info().rss
        tell(done, total)

    report = refit(
        archive,
        settings,
        load_materials(settings.materials.file),
        executor,
        models=MODELS,
        label=secrets.token_hex(8) if label is None else label,
        progress=look,
    )
    return Watched(report, process.memory_info().rss - at_quarter)


def wait_for_workers(executor: TaskExecutor, workers: int) -> None:
    """Wait until a cluster has so many; raise TimeoutError."""
    ends_s = time.monotonic() + WORKERS_WITHIN_S
    while executor.workers < workers:
        if time.monotonic() > ends_s:
            raise TimeoutError(f"{executor.workers} of {workers} workers are there; see their logs")
        time.sleep(_POLL_S)


def copy_campaign(settings: Settings, shots: int) -> None:
    """Import a simulated campaign and copy it, until there are so many shots.

    Parameters
    ----------
    shots : int
        A multiple of `CAMPAIGN`, and not fewer than there are.
    """
    directory = settings.storage.directory
    with Archive.open(directory, reserve_bytes=0) as archive:
        if not archive.shots(limit=1):
            with tempfile.TemporaryDirectory() as place:
                campaign = simulate_campaign(CampaignSettings(), 0)
                archive.import_campaign(write_campaign_folder(Path(place), campaign))
        last = archive.shots(limit=CAMPAIGN)[::-1]
    index = Index(directory / INDEX_NAME)
    try:
        table, numbers = ShotTable(index), NumberSequence(index, directory)
        with index.transaction():
            for number in range(last[-1].number + 1, shots + 1):
                one = last[(number - 1) % CAMPAIGN]
                file = Path(one.file).with_name(f"{number:06d}.h5")
                os.link(directory / one.file, directory / file)
                table.add(dataclasses.replace(one, number=number, file=str(file), origin=""))
            numbers.raise_to(shots)
    finally:
        index.close()


def _clocks(cluster: Cluster) -> Array:
    """Return the time, and the processor time of this process and of the cluster. [s]"""
    return np.array([time.monotonic(), time.process_time(), cluster.processor_s()])


def _memory(seen: Watched) -> Figure:
    return Figure(
        name="memory that the last three quarters added to the process that writes",
        value=float(seen.grown_bytes),
        unit="B",
        goal=f"<= {MEMORY_GOAL_BYTES:g}",
        met=seen.grown_bytes <= MEMORY_GOAL_BYTES,
    )


def _index_bytes(settings: Settings) -> int:
    return (settings.storage.directory / INDEX_NAME).stat().st_size


def main() -> int:
    """Run the study from the command line: ``python -m impactd.bench.study``."""
    blas_threads.keep_to_one()
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.study")
    parser.add_argument("--shots", type=int, default=SIZES[-1], help="of the largest archive")
    parser.add_argument("--workers", type=int, default=WORKERS)
    parser.add_argument("--instant", type=int, metavar="N", help="with a worker of no time")
    parser.add_argument("--folder", type=Path, help="on a real disk; kept afterwards")
    options = parser.parse_args()
    largest = CAMPAIGN * math.ceil(options.shots / CAMPAIGN)
    sizes = [size for size in SIZES if size < largest] + [largest]
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        if options.instant:
            figures = measure_instant(folder, options.instant)
        else:
            figures = measure_study(folder, sizes, workers=options.workers)
    show({"study": figures})
    return 0


if __name__ == "__main__":
    sys.exit(main())
