"""Executors of tasks behind one interface, ``concurrent.futures``: ``submit`` gives a ``Future``.

`WorkerExecutor` keeps warm, killable processes on this machine. A cluster is another executor,
`dask_executor`: the same module-level functions and JSON arguments, as paths and hashes travel and
arrays do not. Both end a future with an error of `impactd.jobs.errors` and say how many `workers`
they have.
"""

# ruff: noqa: PLC0415 - distributed is an optional extra and takes a second to import

from __future__ import annotations

import contextlib
import logging
import threading
import time
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from impactd import blas_threads
from impactd.jobs.errors import (
    ClusterError,
    SchedulerLostError,
    StoppedError,
    TaskError,
    WorkerCrashedError,
)
from impactd.jobs.worker_process import WorkerLimits, WorkerProcess

START_PAUSE_S = 5.0
"""After a worker that would not start; a broken installation must not spin."""
CONNECT_LIMIT_S = 60.0
"""For a scheduler to answer, at first and after it is gone: a machine that boots is longer away."""
RECOUNT_S = 5.0
"""After which a cluster's workers are counted again; they come and go in minutes."""


class TaskExecutor(Executor):
    """An executor that says how many tasks it can run at once."""

    @property
    @abstractmethod
    def workers(self) -> int:
        """Return how many tasks run at once."""


class _Submission:
    def __init__(self, task: str, arguments: tuple[Any, ...], time_s: float | None = None) -> None:
        self.task = task
        self.arguments = arguments
        self.time_s = time_s
        self.cancel = threading.Event()
        self.future: Future[Any] = Future()


class WorkerExecutor(TaskExecutor):
    """Runs module-level functions of JSON values in warm, killable worker processes.

    A crash, a hang or too much memory ends one future with a `WorkerLostError` and one process,
    which is replaced; the other futures do not notice.

    Parameters
    ----------
    warm_up : callable or str, optional
        Module-level function that every process calls at start, or its name.
    import_paths : sequence of Path
        Folders whose modules the workers can import beside the installed ones.
    on_progress : callable, optional
        Hears future, text and share; called from the executor's threads.
    """

    def __init__(
        self,
        limits: WorkerLimits,
        *,
        workers: int = 1,
        warm_up: Callable[[], object] | str | None = None,
        import_paths: Sequence[Path] = (),
        on_progress: Callable[[Future[Any], str, float], None] | None = None,
    ) -> None:
        self._queue: SimpleQueue[_Submission | None] = SimpleQueue()
        self._stop = threading.Event()
        self._door = threading.Lock()
        self._cancels: dict[Future[Any], threading.Event] = {}
        self._warm = threading.Event()
        self._on_progress = on_progress
        self._processes = [
            WorkerProcess(
                limits,
                warm_up="" if warm_up is None else name_of(warm_up),
                import_paths=import_paths,
                stop=self._stop,
            )
            for _ in range(workers)
        ]
        self._threads = [
            threading.Thread(target=self._serve, args=(process,), name=f"worker-{i}", daemon=True)
            for i, process in enumerate(self._processes)
        ]
        for thread in self._threads:
            thread.start()

    @property
    def workers(self) -> int:
        """Return how many processes there are."""
        return len(self._processes)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Queue a task: a module-level function of JSON values.

        The future gets the JSON result, or a `TaskError`. Raises StoppedError if the executor was
        shut down.
        """
        if kwargs:
            raise TypeError("Tasks take positional arguments only.")
        return self.submit_within(None, fn, *args)

    def submit_within(
        self, time_s: float | None, fn: Callable[..., Any] | str, /, *args: Any
    ) -> Future[Any]:
        """Queue a task that may take another time than the limits say; None is the limits' own.

        ``fn`` may be a name ``module:function``; else as `submit`.
        """
        submission = _Submission(name_of(fn), args, time_s)
        with self._door:
            if self._stop.is_set():
                raise StoppedError("The executor was shut down.")
            self._queue.put(submission)
            self._cancels[submission.future] = submission.cancel
        submission.future.add_done_callback(lambda done: self._cancels.pop(done, None))
        return submission.future

    def cancel(self, future: Future[Any]) -> None:
        """End a task that waits or runs; its future then has a `TaskCancelledError`.

        One that is done already stays as it is.
        """
        event = self._cancels.get(future)
        if event is not None:
            event.set()

    def wait_warm(self, timeout_s: float) -> bool:
        """Wait until a worker is warm."""
        return self._warm.wait(timeout_s)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End all workers; running tasks end with `StoppedError`, waiting ones too.

        With ``wait``, return only when all processes are gone. ``cancel_futures`` is ignored:
        nothing runs on without the daemon.
        """
        with self._door:
            self._stop.set()
        for left in self._take_all():
            left.future.set_exception(StoppedError("The daemon is going down."))
        self._queue.put(None)
        if wait:
            for thread in self._threads:
                thread.join()

    def alive(self) -> bool:
        """Return whether every thread that feeds a worker is there."""
        return all(thread.is_alive() for thread in self._threads)

    def pids(self) -> list[int]:
        """Return the process ids of the workers that run."""
        return [process.pid for process in self._processes if process.pid is not None]

    def _serve(self, process: WorkerProcess) -> None:
        try:
            while not self._stop.is_set():
                self._keep_warm(process)
                submission = self._queue.get()
                if submission is None:
                    break
                self._run(process, submission)
        finally:
            self._queue.put(None)  # for the next thread that waits
            process.end()

    def _keep_warm(self, process: WorkerProcess) -> None:
        try:
            process.start()
        except TaskError:
            # The next task meets the same error and reports it; here nobody would hear it.
            self._stop.wait(START_PAUSE_S)
        else:
            self._warm.set()

    def _take_all(self) -> list[_Submission]:
        taken = []
        with contextlib.suppress(Empty):
            while True:
                taken.append(self._queue.get_nowait())
        return [one for one in taken if one is not None]

    def _run(self, process: WorkerProcess, submission: _Submission) -> None:
        future = submission.future
        if not future.set_running_or_notify_cancel():
            return

        def on_progress(text: str, share: float) -> None:
            if self._on_progress is not None:
                self._on_progress(future, text, share)

        try:
            result = process.run(
                submission.task,
                submission.arguments,
                on_progress,
                time_s=submission.time_s,
                cancel=submission.cancel,
            )
        except BaseException as error:  # a future carries whatever happened to its owner
            future.set_exception(error)
        else:
            future.set_result(result)


def name_of(function: Callable[..., object] | str) -> str:
    """Return ``module:function``, by which a worker finds a module-level function."""
    if isinstance(function, str):
        return function
    return f"{function.__module__}:{function.__qualname__}"


def _dask_settings() -> dict[str, Any]:
    """Return the settings that a local cluster must have before its workers start."""
    return {
        # Replaced as a whole: by default it sets MALLOC_TRIM_THRESHOLD_ too, and then glibc gives
        # every array of a fit back to the kernel at once: 18 000 page faults for 16 shots, and on
        # a busy virtual machine a sixth of the speed.
        "distributed.nanny.pre-spawn-environ": blas_threads.environment(),
        # It stops the fit a hundred times a second to look where it is.
        "distributed.worker.profile.enabled": False,
    }


class _ClusterExecutor(TaskExecutor):
    """The executor of a Dask client, with the errors of this program."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._inner = client.get_executor(pure=False, retries=0)
        self._counted, self._counted_s = 1, -RECOUNT_S

    @property
    def workers(self) -> int:
        """Return how many threads the cluster's workers have, 1 while there are none."""
        if self._client.status == "running" and time.monotonic() > self._counted_s + RECOUNT_S:
            with contextlib.suppress(OSError):  # the scheduler is going: the old number will do
                self._counted = max(1, sum(self._client.nthreads().values()))
            self._counted_s = time.monotonic()
        return self._counted

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Queue a task; while the scheduler is away it waits here.

        Raises ClusterError if the scheduler did not come back.
        """
        from distributed.client import ClosedClientError

        inner = None
        with contextlib.suppress(ClosedClientError):
            inner = self._inner.submit(fn, *args, **kwargs)
        if inner is None or self._client.status in ("closing", "closed"):
            raise ClusterError(
                f"The Dask scheduler has been away for {CONNECT_LIMIT_S:g} s. Start it and its "
                "workers, then run the same command again: it goes on with what is not done."
            )
        outer: Future[Any] = Future()
        inner.add_done_callback(lambda done: _pass_on(done, outer))
        return outer


def _pass_on(inner: Future[Any], outer: Future[Any]) -> None:
    """End a future as Dask ended its own."""
    from distributed import KilledWorker

    if inner.cancelled():  # nobody here cancels: the client does so when its scheduler is gone
        outer.set_exception(SchedulerLostError("The Dask scheduler is gone."))
    elif isinstance(error := inner.exception(), KilledWorker):
        outer.set_exception(WorkerCrashedError(f"on each of {error.allowed_failures + 1} workers"))
    elif error is not None:
        outer.set_exception(error)
    else:
        outer.set_result(inner.result())


@contextlib.contextmanager
def dask_executor(
    *,
    workers: int = 2,
    scheduler: str | None = None,
    warm_up: Callable[[], object] | None = None,
) -> Iterator[TaskExecutor]:
    """Run tasks in a Dask cluster, behind the same interface.

    Parameters
    ----------
    workers : int
        Processes of a cluster on this machine; of one thread each, as the solver holds one core.
    scheduler : str, optional
        Address of a cluster that runs already, e.g. ``tcp://host:8786``; ``workers`` is then
        ignored. Its machines must see the shot files under the same paths.
    warm_up : callable, optional
        Called once on every worker before the first task.

    Yields
    ------
    TaskExecutor
        Shut down, with a cluster of our own, at the end of the block.

    Raises
    ------
    ClusterError
        If ``distributed`` is not installed or the scheduler does not answer.

    Notes
    -----
    A task of a worker that died is given to another, up to three times. When the scheduler is
    gone, so are its tasks (`SchedulerLostError`); the next ones wait for it. ``pure=False``: a task
    is not looked up by its arguments. ``retries=0``: a task that raised is not repeated; the caller
    knows which results were written and decides what is done again.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise ClusterError(
            "A Dask cluster needs the package 'distributed': pip install 'impactd[cluster]'."
        ) from error
    with contextlib.ExitStack() as stack:
        stack.enter_context(dask.config.set(_dask_settings()))
        try:
            target = scheduler or stack.enter_context(
                LocalCluster(  # type: ignore[no-untyped-call]  # distributed has no hints
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address=None,
                    silence_logs=logging.ERROR,
                )
            )
            client = stack.enter_context(
                Client(target, timeout=CONNECT_LIMIT_S)  # type: ignore[no-untyped-call]  # the same
            )
        except OSError as error:
            raise ClusterError(
                f"No Dask scheduler answers at {scheduler}: {error}. Start one with "
                "`dask scheduler`, and workers with `dask worker ADDRESS --nthreads 1`."
            ) from error
        if warm_up is not None:
            client.run(warm_up)
        yield _ClusterExecutor(client)
