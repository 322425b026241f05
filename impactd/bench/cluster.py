"""A Dask scheduler and workers as programs of this machine, kept running as systemd keeps them."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import threading
from pathlib import Path
from types import TracebackType

import psutil

from impactd import blas_threads

SCHEDULER = "scheduler"
LOOK_EVERY_S = 0.2
"""A choice: far shorter than a process takes to start."""
_END_WITHIN_S = 10.0


class Cluster:
    """A scheduler and workers of one thread; what ends is started again until the block ends.

    Parameters
    ----------
    folder : Path
        For their logs and files.
    workers : int
        How many.

    Attributes
    ----------
    address : str
        Of the scheduler.
    processes : dict of str to Popen
        ``scheduler``, ``worker-1``, ``worker-2``, ...
    """

    def __init__(self, folder: Path, workers: int) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{port}"
        self._folder = folder
        scheduler = ["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
        worker = ["worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard"]
        worker += ["--local-directory", str(folder)]
        self._words = {SCHEDULER: scheduler}
        self._words |= {f"worker-{number}": worker for number in range(1, workers + 1)}
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._stop = threading.Event()
        self._keeper = threading.Thread(target=self._keep, name="cluster", daemon=True)

    def __enter__(self) -> Cluster:
        self._keeper.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop_keeping()
        for process in self.processes.values():
            process.terminate()
        for process in self.processes.values():
            try:
                process.wait(_END_WITHIN_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def stop_keeping(self) -> None:
        """Start nothing again from now on."""
        self._stop.set()
        self._keeper.join()

    def kill(self, name: str) -> None:
        """Kill one of them with SIGKILL."""
        self.processes[name].kill()

    def processor_s(self) -> float:
        """Return the processor time of those that run now. [s]"""
        times = [psutil.Process(one.pid).cpu_times() for one in self.processes.values()]
        return float(sum(one.user + one.system for one in times))

    def _keep(self) -> None:
        while not self._stop.is_set():
            for name, words in self._words.items():
                process = self.processes.get(name)
                if process is None or process.poll() is not None:
                    self.processes[name] = self._start(name, words)
            self._stop.wait(LOOK_EVERY_S)

    def _start(self, name: str, words: list[str]) -> subprocess.Popen[bytes]:
        environment = {**os.environ, **blas_threads.environment()}
        environment["DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED"] = "false"
        with (self._folder / f"{name}.log").open("ab") as log:
            return subprocess.Popen(  # noqa: S603 - our own words
                [sys.executable, "-m", "dask", *words], stdout=log, stderr=log, env=environment
            )
