"""What ``impactd refit`` does: an executor, a bar, a report."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from analysis.written_numbers import counted
from impactd.console.failure import Failure
from impactd.console.options import settings_of
from impactd.console.progress_bar import progress
from impactd.console.tables import print_json
from impactd.daemon import check_model
from impactd.jobs.executors import TaskExecutor, WorkerExecutor, dask_executor
from impactd.jobs.tasks import warm_up
from impactd.jobs.worker_process import WorkerLimits
from impactd.refit import CHUNK, refit
from impactd.settings.material_book import MaterialBook
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive

MOST_REASONS = 10


def run(
    kind: str,
    *,
    workers: int,
    scheduler: str | None,
    models: list[str] | None,
    label: str,
    config: Path | None,
    data: Path | None,
    as_json: bool,
) -> None:
    """Fit the archive again and say how it went.

    Parameters
    ----------
    kind : str
        ``process`` or ``dask``.
    scheduler : str or None
        Address of a running Dask cluster.
    models : list of str, optional
        Which to fit; by default those that every new shot is fitted with.
    label : str
        See `impactd.refit.run_name`.
    config, data : Path or None
        As given on the command line.
    as_json : bool
        Print the report as JSON.

    Raises
    ------
    Failure
        If shots could not be fitted.
    """
    for name in models or ():
        check_model(name)
    settings = settings_of(config, data)
    book = MaterialBook(settings.materials.file, settings.storage.directory)
    materials = book.current
    storage = settings.storage
    with (
        Archive.open(storage.directory, reserve_bytes=storage.reserve_bytes) as archive,
        executor_named(kind, settings, workers=workers, scheduler=scheduler) as executor,
    ):
        report = refit(
            archive,
            settings,
            materials,
            executor,
            models=models,
            label=label,
            progress=lambda done, total: progress(
                f"{done} of {counted(total, 'shot')}", share=done / max(total, 1)
            ),
        )
    progress("", last=True)
    if as_json:
        print_json(asdict(report))
    else:
        if report.before:
            print(f"{report.before} shots were already done.")
        rate = report.fitted / report.duration_s if report.duration_s > 0 else 0.0
        print(f"Fitted {report.fitted} shots in {report.duration_s:.1f} s ({rate:.0f} per second).")
    if report.failed:
        reasons = [f"shot {n}: {why}" for n, why in sorted(report.failed.items())]
        more = len(reasons) - MOST_REASONS
        if more > 0:
            reasons[MOST_REASONS:] = [f"and {more} more"]
        raise Failure(
            f"{counted(len(report.failed), 'shot')} could not be fitted. {'; '.join(reasons)}"
        )


@contextmanager
def executor_named(
    kind: str, settings: Settings, *, workers: int, scheduler: str | None = None
) -> Iterator[TaskExecutor]:
    """Provide the executor of a name, warm.

    Parameters
    ----------
    kind : str
        ``process`` or ``dask``.
    scheduler : str, optional
        Address of a running Dask cluster.
    """
    if kind == "dask":
        with dask_executor(workers=workers, scheduler=scheduler, warm_up=warm_up) as executor:
            yield executor
        return
    limits = WorkerLimits(settings.jobs.fit_time_limit_s * CHUNK, settings.jobs.fit_memory_bytes)
    local = WorkerExecutor(limits, workers=workers, warm_up=warm_up)
    try:
        local.wait_warm(60.0)
        yield local
    finally:
        local.shutdown()
