"""Fit every shot of the archive again: after a calibration, a corrected mass, a better model.

A run has a name made of all that its fits depend on besides the shots: models, cell, materials,
release and program. The same knowledge gives the same run, so that

- what was killed goes on where it was: a shot's fits and the mark that it is done are one row each,
  written together;
- asking twice does the work once;
- a new calibration is a new run, and the old fits stay beside the new ones.

Orders travel to the workers, results come back; only this process writes. At most a few chunks per
worker are under way, so memory does not grow with the archive. What a lost worker or scheduler had
is handed out again.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import contextmanager
from dataclasses import dataclass, field

from impactd.aliases import Json
from impactd.jobs.errors import SchedulerLostError, WorkerLostError
from impactd.jobs.executors import TaskExecutor
from impactd.jobs.orders import order_without_shots, shot_models, shot_places
from impactd.jobs.refit_task import fit_chunk
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError
from impactd.storage.index import as_text
from impactd.storage.version import software

CHUNK = 16
"""Shots a worker takes at once: enough that the way there and back costs little."""
AHEAD = 3
"""Chunks under way for each worker."""
LOCK_NAME = "refit.lock"


@dataclass
class RefitReport:
    """The outcome of a re-fit."""

    run: str
    """Its name."""
    before: int
    """Shots that were done already when it started."""
    fitted: int = 0
    """Shots that it did."""
    failed: dict[int, str] = field(default_factory=dict)
    """Shots that could not be fitted, with the reason; the next start tries them again."""
    duration_s: float = 0.0


def run_name(order: Json, label: str = "") -> str:
    """Return the name of a run: the same for the same knowledge, models and program.

    The order is from `orders.order_without_shots`. Another ``label``, a person's own, makes another
    run of the same knowledge.
    """
    text = as_text({**order, "software": software(), "label": label})
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def refit(
    archive: Archive,
    settings: Settings,
    materials: Materials,
    executor: TaskExecutor,
    *,
    models: Sequence[str] | None = None,
    label: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> RefitReport:
    """Fit every shot that this run has not fitted yet; a daemon may serve the archive meanwhile.

    Parameters
    ----------
    models : sequence of str, optional
        By default those that every new shot is fitted with.
    label : str
        See `run_name`.
    progress : callable, optional
        Hears shots done, those of an earlier start included, and shots in all.

    Raises
    ------
    ArchiveError
        If another re-fit of this archive is under way.
    ClusterError
        If the scheduler of a cluster is gone and does not come back. What is done is kept.
    """
    wanted = models or shot_models(archive)
    order = order_without_shots(archive, settings, materials, wanted)
    run = run_name(order, label)
    started_s = time.monotonic()
    with _alone(archive):
        report = RefitReport(run, archive.fits.count_in_run(run))
        total = report.before + archive.fits.count_not_in_run(run)
        chunks = _chunks(archive, run)
        pending: dict[Future[list[Json]], list[int]] = {}
        while True:
            while len(pending) < AHEAD * executor.workers and (numbers := next(chunks, None)):
                _submit(executor, archive, order, numbers, pending)
            if not pending:
                break
            finished, _ = wait(pending, return_when=FIRST_COMPLETED)
            for future in finished:
                numbers = pending.pop(future)
                for again in _take(future, numbers, archive, report):
                    _submit(executor, archive, order, again, pending)
                if progress is not None:
                    progress(report.before + report.fitted + len(report.failed), total)
        if report.fitted:
            archive.events.append("refit.done", {"run": run, "fitted": report.fitted})
    report.duration_s = time.monotonic() - started_s
    return report


def _chunks(archive: Archive, run: str) -> Iterator[list[int]]:
    """Yield shots that are not done, a chunk at a time, each once."""
    last = 0
    while numbers := archive.fits.not_in_run(run, after=last, limit=CHUNK):
        last = numbers[-1]
        yield numbers


def _submit(
    executor: TaskExecutor,
    archive: Archive,
    order: Json,
    numbers: list[int],
    pending: dict[Future[list[Json]], list[int]],
) -> None:
    future = executor.submit(fit_chunk, {**order, "shots": shot_places(archive, numbers)})
    pending[future] = numbers


def _take(
    future: Future[list[Json]], numbers: list[int], archive: Archive, report: RefitReport
) -> list[list[int]]:
    """Write the results of a chunk; return the chunks to try again."""
    error = future.exception()
    if isinstance(error, SchedulerLostError):
        return [numbers]
    if isinstance(error, WorkerLostError) and len(numbers) > 1:
        return [[one] for one in numbers]  # one took the worker with it; alone it harms no other
    if error is not None:
        report.failed.update(dict.fromkeys(numbers, str(error) or type(error).__name__))
        return []
    with archive.transaction():
        for one in future.result():
            if "error" in one:
                report.failed[one["shot"]] = one["error"]
                continue
            for fit in one["fits"]:
                archive.fits.add(one["shot"], fit["model"], fit["calibration"], fit, run=report.run)
            report.fitted += 1
    return []


@contextmanager
def _alone(archive: Archive) -> Iterator[None]:
    """Hold the lock of re-fits: two at once would do the same shots."""
    path = archive.directory / LOCK_NAME
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o640)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ArchiveError(
                f"Another re-fit of {archive.directory} is under way.",
                remedy="Wait for it, or end it: its finished fits are kept.",
            ) from None
        yield
    finally:
        os.close(descriptor)
