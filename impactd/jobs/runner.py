"""Takes jobs from the queue, has warm workers do them in two lanes, and writes the results.

Comparisons of shots with their repetitions have a lane and a worker of their own: whoever stands at
the rig does not wait for a diagnosis.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import structlog

from impactd.jobs.errors import StoppedError, TaskCancelledError, TaskError, WorkerLostError
from impactd.jobs.executors import WorkerExecutor
from impactd.jobs.orders import order_for
from impactd.jobs.results import CANCELLED, ResultWriter, Told
from impactd.jobs.worker_process import WorkerLimits, spare_cores
from impactd.jobs.write_queue import Write, WriteQueue, will_pass
from impactd.settings.materials import Materials, load_materials
from impactd.settings.settings import Settings
from impactd.storage.archive import Archive, ArchiveError
from impactd.storage.jobs import COMPARE, DIAGNOSE, Job

_log = structlog.get_logger("impactd.jobs")
POLL_S = 0.5
"""Jobs that other processes add are seen after so long; our own ring a bell."""
ALIVE_S = 30.0
DIAGNOSIS_TIMES = 10.0
"""A diagnosis is a few hundred fits, most of them cut short: so many times a fit's limit."""

Task = Callable[[dict[str, Any]], dict[str, Any]] | str
"""A module-level function, or its name: this process need not load what only its workers run."""

TASKS: dict[str, Task] = {
    COMPARE: f"impactd.jobs.comparison:{COMPARE}",
    **{
        kind: f"impactd.jobs.tasks:{kind}"
        for kind in ("fit_shot", "fit_campaign", "calibrate", DIAGNOSE)
    },
}
_WARM_UP = "impactd.jobs.tasks:warm_up"
_WARM_UP_COMPARISON = "impactd.jobs.comparison:warm_up"


@dataclass
class _Lane:
    """Jobs that wait for one another."""

    prompt: bool
    executor: WorkerExecutor
    free: threading.Semaphore
    last_turn_s: float
    thread: threading.Thread | None = None

    def alive(self) -> bool:
        """Return whether its thread checked the queue lately, and its executor is alive."""
        if self.thread is None or not self.thread.is_alive() or not self.executor.alive():
            return False
        return time.monotonic() - self.last_turn_s < ALIVE_S


class JobRunner:
    """Takes jobs from the queue and has warm workers do them.

    Parameters
    ----------
    on_event : callable
        Gets kind and data of each event: ``job.started``, ``job.progress``, ``job.retried``,
        ``job.failed``, ``job.cancelled``, ``fit.done``, ``drop.analysed``, ``calibration.done``,
        ``calibration.failed``, ``diagnosis.done``, ``shot.unlike``.
    materials : Materials, optional
        Read from the settings' file when absent.
    tasks : mapping, optional
        What a kind of job calls; tests bring their own, which crash and hang.
    import_paths : sequence of Path
        Where workers find the modules of such tasks.
    """

    def __init__(
        self,
        archive: Archive,
        settings: Settings,
        on_event: Callable[[str, dict[str, Any]], None],
        *,
        materials: Materials | None = None,
        tasks: Mapping[str, Task] | None = None,
        import_paths: Sequence[Path] = (),
    ) -> None:
        self._archive = archive
        self._settings = settings
        self._announce = on_event
        self._materials = materials or load_materials(settings.materials.file)
        self._tasks = TASKS if tasks is None else tasks
        self._warm_up = _WARM_UP if tasks is None else None
        self._import_paths = import_paths
        self._results = ResultWriter(archive, settings)
        self._writes = WriteQueue()
        self._lanes: dict[bool, _Lane] = {}
        self._stop = threading.Event()
        self._running: dict[Future[Any], Job] = {}
        self._unwanted: set[int] = set()
        self._progress: dict[int, tuple[str, float]] = {}

    def use_materials(self, materials: Materials) -> None:
        """Use these materials for the fits that begin from now on."""
        self._materials = materials

    def start(self) -> None:
        """Start the workers, which warm up in the background, and begin to take jobs."""
        if self._lanes:
            return
        self._stop.clear()
        self._lanes = {False: self._lane(prompt=False)}
        if COMPARE in self._tasks:
            self._lanes[True] = self._lane(prompt=True)
        self._writes.start()
        for lane in self._lanes.values():
            name = "comparisons" if lane.prompt else "jobs"
            lane.thread = threading.Thread(target=self._run, args=(lane,), name=name, daemon=True)
            lane.thread.start()

    def _lane(self, *, prompt: bool) -> _Lane:
        jobs = self._settings.jobs
        workers = 1 if prompt else jobs.workers
        cores = 1 if prompt else spare_cores(workers)
        executor = WorkerExecutor(
            WorkerLimits(jobs.fit_time_limit_s, jobs.fit_memory_bytes, cores),
            workers=workers,
            warm_up=_WARM_UP_COMPARISON if prompt and self._warm_up else self._warm_up,
            import_paths=self._import_paths,
            on_progress=self._on_progress,
        )
        return _Lane(prompt, executor, threading.Semaphore(workers), time.monotonic())

    def stop(self) -> None:
        """End the workers; a job that runs waits again, as if it had not been started.

        What could not be written is tried once more. A job whose end is not written then waits
        again when the archive is next opened, as after a crash.
        """
        if not self._lanes:
            return
        self._stop.set()
        self._archive.jobs.arrival.set()
        for lane in self._lanes.values():
            lane.free.release()
            assert lane.thread is not None
            lane.thread.join()
            lane.executor.shutdown()
        self._writes.stop()
        self._lanes = {}

    def alive(self) -> bool:
        """Return whether the queue was checked lately; a long fit does not count against it."""
        lanes = list(self._lanes.values())
        return bool(lanes) and self._writes.alive() and all(lane.alive() for lane in lanes)

    def cancel(self, number: int) -> Job:
        """End a job that waits or runs; one that has ended stays as it is.

        A running one ends within moments after the return. Raises NotFoundError.
        """
        if self._archive.jobs.cancel_waiting(number, CANCELLED):
            job = self._archive.jobs.get(number)
            told = {"job": job.id, "kind": job.kind, "subject": job.subject}
            self._announce("job.cancelled", told)
            return job
        job = self._archive.jobs.get(number)
        lane = self._lane_of(job)
        if job.state == "running" and lane is not None:
            # noted first: a job that is just being submitted looks here once it has its future
            self._unwanted.add(number)
            for future, running in list(self._running.items()):
                if running.id == number:
                    lane.executor.cancel(future)
        return job

    def _lane_of(self, job: Job) -> _Lane | None:
        return self._lanes.get(job.kind == COMPARE)

    def progress(self, number: int) -> tuple[str, float] | None:
        """Return a running job's last report: text and share done, None where there is none."""
        return self._progress.get(number)

    def wait_warm(self, timeout_s: float) -> bool:
        """Wait until a worker is warm; the first fit then takes no longer than any other."""
        lane = self._lanes.get(False)
        return lane is not None and lane.executor.wait_warm(timeout_s)

    def _run(self, lane: _Lane) -> None:
        arrival = self._archive.jobs.arrival
        while not self._stop.is_set():
            lane.last_turn_s = time.monotonic()
            if not lane.free.acquire(timeout=POLL_S):
                continue
            arrival.clear()
            job = None
            try:
                # Results that cannot be written stay in memory: no more of them until they can.
                wait = self._stop.is_set() or self._writes.stuck
                job = None if wait else self._archive.jobs.claim(prompt=lane.prompt)
            except ArchiveError:
                _log.exception("the queue does not answer")
                self._stop.wait(POLL_S)
            if job is None:
                lane.free.release()
                arrival.wait(POLL_S)
            else:
                self._submit(lane, job)

    def _submit(self, lane: _Lane, job: Job) -> None:
        try:
            task = self._task(job.kind)
            order = order_for(job, self._archive, self._settings, self._materials)
        except Exception as error:  # whatever is wrong with one job must not stop the queue
            self._end(lane, job, error)
            return
        started = {"job": job.id, "kind": job.kind, "subject": job.subject}
        self._writes.put(self._telling(("job.started", started)))
        limit_s = self._settings.jobs.fit_time_limit_s
        time_s = DIAGNOSIS_TIMES * limit_s if job.kind == DIAGNOSE else None
        future = lane.executor.submit_within(time_s, task, order)
        self._running[future] = job
        if job.id in self._unwanted:
            lane.executor.cancel(future)
        future.add_done_callback(partial(self._done, lane))

    def _task(self, kind: str) -> Task:
        if kind not in self._tasks:
            raise ArchiveError(f"This version knows no job of the kind {kind!r}.")
        return self._tasks[kind]

    def _done(self, lane: _Lane, future: Future[Any]) -> None:
        job = self._running.pop(future)
        self._progress.pop(job.id, None)
        self._end(lane, job, future.exception() or future.result())

    def _end(self, lane: _Lane, job: Job, outcome: BaseException | dict[str, Any]) -> None:
        """Queue the write of a job's end; its place is free at once."""
        if isinstance(outcome, Exception) and not isinstance(outcome, TaskError | ArchiveError):
            _log.error("a job failed in the daemon", job=job.id, exc_info=outcome)

        def write() -> list[Write]:
            events = self._write_end(job, outcome)
            self._unwanted.discard(job.id)
            self._archive.jobs.arrival.set()  # it may be one that is tried again
            return [self._telling(event) for event in events]

        self._writes.put(write)
        lane.free.release()

    def _write_end(self, job: Job, outcome: BaseException | dict[str, Any]) -> list[Told]:
        if isinstance(outcome, StoppedError):
            self._archive.jobs.give_back(job.id)
            return []
        if isinstance(outcome, TaskCancelledError):
            return self._results.cancel(job)
        if isinstance(outcome, BaseException):
            retry = isinstance(outcome, WorkerLostError)
            return self._results.fail(job, str(outcome), retry=retry)
        try:
            return self._results.finish(job, outcome)
        except Exception as problem:  # a result that can never be written is this job's failure
            if will_pass(problem):
                raise
            _log.exception("a result could not be written", job=job.id)
            return self._results.fail(job, str(problem), retry=False)

    def _telling(self, event: Told) -> Write:
        def tell() -> list[Write]:
            self._announce(*event)
            return []

        return tell

    def _on_progress(self, future: Future[Any], text: str, share: float) -> None:
        job = self._running.get(future)
        if job is not None:
            self._progress[job.id] = (text, share)
            told = {"job": job.id, "subject": job.subject, "text": text, "share": share}
            if not self._writes.stuck:  # the next one says the same
                self._writes.put(self._telling(("job.progress", told)))
