"""Where tasks run, behind the one seam of ``concurrent.futures``: ``submit`` gives a ``Future``.

`WorkerExecutor` keeps warm, killable processes on this machine. A cluster is another executor:
``distributed.Client(...).get_executor(pure=False, retries=0)`` takes the same module-level
functions and JSON arguments, as paths and hashes travel and arrays do not.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from impactd.jobs.errors import StoppedError, TaskError
from impactd.jobs.worker_process import WorkerLimits, WorkerProcess

START_PAUSE_S = 5.0
"""After a worker that would not start; a broken installation must not spin."""


class _Submission:
    def __init__(self, task: str, arguments: tuple[Any, ...]) -> None:
        self.task = task
        self.arguments = arguments
        self.future: Future[Any] = Future()


class WorkerExecutor(Executor):
    """Runs module-level functions of JSON values in warm, killable worker processes.

    A crash, a hang or a hunger for memory ends one future with a `WorkerLostError` and one process,
    which is replaced; the other futures do not notice.

    Parameters
    ----------
    limits : WorkerLimits
        What a task may take.
    workers : int
        How many processes.
    warm_up : callable, optional
        Module-level function that every process calls at start.
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
        warm_up: Callable[[], object] | None = None,
        import_paths: Sequence[Path] = (),
        on_progress: Callable[[Future[Any], str, float], None] | None = None,
    ) -> None:
        self._queue: SimpleQueue[_Submission | None] = SimpleQueue()
        self._stop = threading.Event()
        self._door = threading.Lock()
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

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Queue a task.

        Parameters
        ----------
        fn : callable
            A module-level function.
        *args
            JSON values.
        **kwargs
            Not supported.

        Returns
        -------
        Future
            Gets the JSON result, or a `TaskError`.

        Raises
        ------
        StoppedError
            If the executor was shut down.
        """
        if kwargs:
            raise TypeError("Tasks take positional arguments only.")
        submission = _Submission(name_of(fn), args)
        with self._door:
            if self._stop.is_set():
                raise StoppedError("The executor was shut down.")
            self._queue.put(submission)
        return submission.future

    def wait_warm(self, timeout_s: float) -> bool:
        """Wait until a worker is warm.

        Parameters
        ----------
        timeout_s : float
            [s]

        Returns
        -------
        bool
            Whether one is.
        """
        return self._warm.wait(timeout_s)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = True) -> None:
        """End all workers; running tasks end with `StoppedError`, waiting ones too.

        Parameters
        ----------
        wait : bool
            Whether to return only when all processes are gone.
        cancel_futures : bool
            Ignored: nothing runs on without the daemon.
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
            result = process.run(submission.task, submission.arguments, on_progress)
        except BaseException as error:  # a future carries whatever happened to its owner
            future.set_exception(error)
        else:
            future.set_result(result)


def name_of(function: Callable[..., object]) -> str:
    """Return ``module:function``, by which a worker finds a module-level function."""
    return f"{function.__module__}:{function.__qualname__}"
