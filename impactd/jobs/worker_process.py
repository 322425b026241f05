"""One warm worker process, as the daemon sees it: a task goes in, a result or an error comes out.

The process is killed, with all its children, when a task takes too long or too much memory, and
replaced at once, so that the next task finds a warm one again.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import selectors
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from impactd import blas_threads
from impactd.jobs.errors import (
    StoppedError,
    TaskCancelledError,
    TaskFailedError,
    TaskMemoryError,
    TaskTimeoutError,
    WorkerCrashedError,
)

LOOK_EVERY_S = 0.05
START_LIMIT_S = 180.0
"""A first start compiles the solver; on a slow machine that takes a minute."""
_LAST_WORDS_BYTES = 600
_CORES = "NUMBA_NUM_THREADS"
"""Says how many cores a fit uses, see `analysis.fit.over_shots.CORES`."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class WorkerLimits:
    """What a task may take."""

    time_s: float
    """Wall time, the start of the process not counted. [s]"""
    memory_bytes: int
    """Beyond the idle process. [B]"""
    cores: int = 1
    """That one task may use at once."""


def spare_cores(workers: int) -> int:
    """Return the cores for each of some workers when one is left to the sample stream; at least 1.

    Workers are of a lower priority as well (`impactd.jobs.worker`).
    """
    return max(1, (len(os.sched_getaffinity(0)) - 1) // workers)


class WorkerProcess:
    """One warm worker process; used by one thread.

    Parameters
    ----------
    warm_up : str
        ``module:function`` that it calls at start, empty for none.
    import_paths : sequence of Path
        Folders whose modules it can import beside the installed ones.
    stop : threading.Event
        Ends a running task from another thread.
    """

    def __init__(
        self,
        limits: WorkerLimits,
        *,
        warm_up: str,
        import_paths: Sequence[Path],
        stop: threading.Event,
    ) -> None:
        self._limits = limits
        self._warm_up = warm_up
        self._import_paths = import_paths
        self._stop = stop
        self._cancel: threading.Event | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._pending = b""
        self._idle_bytes = 0

    @property
    def pid(self) -> int | None:
        """Process id, ``None`` before the start and after the end."""
        return None if self._process is None else self._process.pid

    def start(self) -> None:
        """Start and wait until it is warm; do nothing when it is.

        Raises
        ------
        WorkerCrashedError
            If it dies while it warms up.
        TaskTimeoutError
            If it is not warm in time.
        StoppedError
            If it was stopped meanwhile.
        """
        if self._process is not None and self._process.poll() is None:
            return
        self.end()
        paths = [*map(str, self._import_paths), os.environ.get("PYTHONPATH", "")]
        environment = {
            **os.environ,
            **blas_threads.environment(),
            _CORES: str(self._limits.cores),
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        }
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - closed in end()
        self._process = subprocess.Popen(  # noqa: S603 - our own module
            [
                sys.executable,
                "-m",
                "impactd.jobs.worker",
                f"--parent={os.getpid()}",
                f"--memory-bytes={self._limits.memory_bytes}",
                f"--warm-up={self._warm_up}",
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=environment,
            start_new_session=True,
        )
        self._pending = b""
        try:
            self._wait("ready", START_LIMIT_S, lambda _text, _share: None, watch_memory=False)
        except BaseException:
            self.end()
            raise
        self._idle_bytes = self._memory_bytes()

    def run(
        self,
        task: str,
        arguments: Sequence[Any],
        on_progress: Progress,
        *,
        time_s: float | None = None,
        cancel: threading.Event | None = None,
    ) -> Any:
        """Run the task ``module:function`` on JSON values and return its JSON result.

        It may take ``time_s`` instead of the limits' own time. ``cancel`` ends it when it is set.

        Raises
        ------
        TaskFailedError
            If it raised.
        WorkerCrashedError, TaskTimeoutError, TaskMemoryError
            If the process is gone.
        StoppedError, TaskCancelledError
            If it was stopped or cancelled meanwhile.
        """
        self.start()
        self._cancel = cancel
        assert self._process is not None
        assert self._process.stdin is not None
        line = json.dumps({"task": task, "arguments": list(arguments)}, allow_nan=False) + "\n"
        try:
            try:
                self._process.stdin.write(line.encode())
                self._process.stdin.flush()
            except BrokenPipeError:
                raise self._crash() from None
            answer = self._wait(
                "result", time_s or self._limits.time_s, on_progress, watch_memory=True
            )
        except TaskFailedError:
            raise
        except BaseException:
            self.end()
            raise
        finally:
            self._cancel = None
        return answer["result"]

    def end(self) -> None:
        """Kill the process and everything it started."""
        process, self._process = self._process, None
        if process is not None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    with contextlib.suppress(BrokenPipeError):
                        pipe.close()
        if self._errors is not None:
            self._errors.close()
            self._errors = None

    def _wait(
        self, key: str, limit_s: float, on_progress: Progress, *, watch_memory: bool
    ) -> dict[str, Any]:
        assert self._process is not None
        assert self._process.stdout is not None
        deadline = time.monotonic() + limit_s
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while True:
                if self._stop.is_set():
                    raise StoppedError("The daemon is going down.")
                if self._cancel is not None and self._cancel.is_set():
                    raise TaskCancelledError("It was cancelled.")
                if time.monotonic() > deadline:
                    raise TaskTimeoutError(limit_s)
                if watch_memory:
                    self._check_memory()
                if not selector.select(LOOK_EVERY_S):
                    continue
                for answer in self._answers():
                    if "progress" in answer:
                        on_progress(*answer["progress"])
                    elif "error" in answer:
                        raise TaskFailedError(*answer["error"])
                    elif "out_of_memory" in answer:
                        raise TaskMemoryError(self._limits.memory_bytes)
                    elif key in answer:
                        return answer

    def _answers(self) -> list[dict[str, Any]]:
        assert self._process is not None
        assert self._process.stdout is not None
        found = os.read(self._process.stdout.fileno(), 1 << 20)
        if not found:
            raise self._crash()
        *lines, self._pending = (self._pending + found).split(b"\n")
        return [json.loads(line) for line in lines]

    def _crash(self) -> WorkerCrashedError:
        assert self._process is not None
        try:
            code = self._process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            return WorkerCrashedError("it closed its output and went on", self._last_words())
        how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
        return WorkerCrashedError(how, self._last_words())

    def _last_words(self) -> str:
        if self._errors is None:
            return ""
        self._errors.seek(0, os.SEEK_END)
        self._errors.seek(max(0, self._errors.tell() - _LAST_WORDS_BYTES))
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
        return lines[-1] if lines else ""

    def _memory_bytes(self) -> int:
        try:
            pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        except (OSError, IndexError):  # it died between two looks; reading its pipe tells how
            return 0
        return pages * resource.getpagesize()

    def _check_memory(self) -> None:
        # The worker's own limit on its address space stops what grows in one leap; this look stops
        # what a native library took in spite of it.
        if self._memory_bytes() - self._idle_bytes > self._limits.memory_bytes:
            raise TaskMemoryError(self._limits.memory_bytes)


def run_apart(
    task: str, arguments: Sequence[Any], limits: WorkerLimits, stop: threading.Event
) -> Any:
    """Run one task in a process that is started for it and ended behind it; see `WorkerProcess`."""
    process = WorkerProcess(limits, warm_up="", import_paths=(), stop=stop)
    try:
        return process.run(task, arguments, lambda _text, _share: None)
    finally:
        process.end()
