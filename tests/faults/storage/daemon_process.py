"""A daemon in a process of its own, on a simulated rig four times as fast as a real one."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import httpx2

from impactd.storage.archive import Archive
from tests.simulated_rig import write_simulated_rig

HERE = Path(__file__).parent
DROP = {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "operator": "ab"}
START_LIMIT_S = 600.0
"""Only a liveness limit: a starved host takes minutes for three seconds of work."""
ENDED = ("stored", "analysed", "failed", "aborted", "interrupted")


class DaemonProcess:
    """The daemon, what falls on its rig, and a client.

    Parameters
    ----------
    folder : Path
        Gets configuration, archive (`data`), journal of falls and log.
    clock_speed : str
        Of the simulated rig, as in TOML.
    before : sequence of str
        Command that runs the daemon, e.g. ``strace ...``.
    changes : dict
        Lines of the configuration to replace, old text to new text.
    """

    def __init__(
        self,
        folder: Path,
        *,
        clock_speed: str = "4.0",
        before: Sequence[str] = (),
        changes: dict[str, str] | None = None,
        data: Path | None = None,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.data = data or folder / "data"
        self.journal = folder / "falls"
        self.log = folder / "serve.log"
        self.before = tuple(before)
        self.config = write_simulated_rig(folder, clock_speed=clock_speed, changes=changes)
        with Archive.open(self.data, reserve_bytes=0) as archive:
            secret = archive.tokens.create("tester", "operate")[1]
        self._headers = {"Authorization": f"Bearer {secret}"}
        self.process: subprocess.Popen[bytes] | None = None
        self.url = ""
        self.start_cpu_s = 0.0
        self.client: httpx2.Client | None = None

    def start(self) -> float:
        """Start the process; return how long it took until the rig was ready. [s]"""
        began_s = time.monotonic()
        serve = ["serve", "--port", "0", "--config", str(self.config), "--data", str(self.data)]
        with self.log.open("ab") as log:
            from_here = log.tell()
            self.process = subprocess.Popen(
                [*self.before, sys.executable, str(HERE / "journalled_daemon.py"), *serve],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=log,
                env={**os.environ, "FALLS_JOURNAL": str(self.journal)},
            )
        self.url = until(lambda: self._listening(from_here), bool, START_LIMIT_S)
        self.client = httpx2.Client(
            base_url=self.url, headers=self._headers, timeout=30, trust_env=False
        )
        until(lambda: self.get("/v1/status"), lambda status: status["ready"])
        took_s = time.monotonic() - began_s
        self.start_cpu_s = self._cpu_s()
        return took_s

    def _cpu_s(self) -> float:
        """Return what the process has computed so far; no busy host changes that. [s]"""
        assert self.process is not None
        stat = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")

    def _listening(self, from_here: int) -> str:
        assert self.process is not None
        assert self.process.poll() is None, self.log.read_text()
        found = re.search(r"event=listening url=(\S+)", self.log.read_text()[from_here:])
        return found[1] if found else ""

    def get(self, path: str) -> dict[str, Any]:
        """Return the JSON of a resource."""
        assert self.client is not None
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def post(self, path: str, body: dict[str, Any], key: str) -> httpx2.Response:
        """Ask for something under an idempotency key."""
        assert self.client is not None
        return self.client.post(path, json=body, headers={"Idempotency-Key": key})

    def falls(self) -> int:
        """Return how many spheres fell on this rig, whatever the archive says."""
        return len(self.journal.read_text().splitlines()) if self.journal.exists() else 0

    def kill(self) -> None:
        """End the process as the kernel does it: no handler runs."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(timeout=30)
        self._close()

    def stop(self) -> int:
        """End the process in an orderly way; return its exit code."""
        assert self.process is not None
        self._close()
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=60)

    def __enter__(self) -> DaemonProcess:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process is not None and self.process.poll() is None:
            self.kill()

    def _close(self) -> None:
        if self.client is not None:
            self.client.close()
            self.client = None


def until(look: Callable[[], Any], fine: Callable[[Any], bool], limit_s: float = 120.0) -> Any:
    """Return what `look` returns once it is fine; a liveness limit, not a measurement."""
    end_s = time.monotonic() + limit_s
    while True:
        seen = look()
        if fine(seen):
            return seen
        assert time.monotonic() < end_s, f"still {seen} after {limit_s} s"
        time.sleep(0.01)
