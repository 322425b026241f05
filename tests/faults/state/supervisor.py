"""A daemon on a relay board that outlives it, kept alive the way systemd would."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import time
import uuid
from collections.abc import Callable
from pathlib import Path

import httpx2

from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings
from impactd.data_lock import LOCK_NAME
from impactd.storage.archive import Archive
from tests.simulated_rig import write_simulated_rig

HERE = Path(__file__).parent
DROP = {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "operator": "ab"}


class Supervisor:
    """Does with the daemon what systemd does: listens to its heart, ends it, starts it again.

    A stand-in, because a test may run where systemd does not.
    """

    def __init__(self, folder: Path, *, watchdog_s: float, abort_s: float, pause_s: float) -> None:
        self._watchdog_s, self._abort_s, self._pause_s = watchdog_s, abort_s, pause_s
        self._folder = folder
        self._heart = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._heart.bind(str(folder / "notify"))
        self.world = World(WorldSettings())
        self.board = RelayTerminal(self.world)
        self.data = folder / "data"
        write_simulated_rig(
            folder, clock_speed="1.0", changes={"loading_s": "impact_margin_s = 10.0\nloading_s"}
        )
        with Archive.open(self.data, reserve_bytes=0) as archive:
            secret = archive.tokens.create("tester", "operate")[1]
        self.headers = {"Authorization": f"Bearer {secret}"}
        self.process: subprocess.Popen[bytes]
        self.url = ""

    def start(self) -> None:
        """Start the daemon and wait for its READY=1."""
        command = [sys.executable, str(HERE / "daemon_on_a_port.py"), "serve", "--port", "0"]
        with (self._folder / "log").open("ab") as log:
            self.process = subprocess.Popen(
                [*command, "--config", str(self._folder / "rig.toml"), "--data", str(self.data)],
                stderr=log,
                env={
                    **os.environ,
                    "NOTIFY_SOCKET": str(self._folder / "notify"),
                    "WATCHDOG_USEC": str(round(self._watchdog_s * 1e6)),
                    "RELAY_PORT": self.board.port,
                },
            )
        assert self._hear("READY=1", 60.0), (self._folder / "log").read_text()
        self.url = str(json.loads((self.data / LOCK_NAME).read_text())["url"])

    def _hear(self, word: str, limit_s: float) -> bool:
        """Wait for a word of the daemon; return whether it came."""
        ends_s = time.monotonic() + limit_s
        while (left_s := ends_s - time.monotonic()) > 0:
            self._heart.settimeout(left_s)
            try:
                if word in self._heart.recv(4096).decode():
                    return True
            except TimeoutError:
                break
        return False

    def watch(self) -> None:
        """Let the daemon live as long as its heart beats, then replace it."""
        while self._hear("WATCHDOG=1", self._watchdog_s):
            continue
        self.process.send_signal(signal.SIGABRT)
        try:
            self.process.wait(self._abort_s)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        time.sleep(self._pause_s)
        self.start()

    def end(self) -> None:
        """End the daemon and its board."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
            self.process.wait(60)
        self.board.close()
        self._heart.close()

    def open_valve(self) -> None:
        """Start the daemon and ask for a drop; return while its valve is open."""
        self.start()
        with httpx2.Client(
            base_url=self.url, headers=self.headers, timeout=30, trust_env=False
        ) as client:
            until(lambda: client.get("/v1/status").json()["ready"], "never ready")
            self.world.load("acetal", "aluminium", 0.03)
            key = {"Idempotency-Key": str(uuid.uuid4())}
            assert client.post("/v1/drops", json=DROP, headers=key).status_code == 202
        until(lambda: self.board.relay_on, "the valve never opened")


def until(look: Callable[[], bool], what: str) -> None:
    """Wait until something is so, a minute at most."""
    ends_s = time.monotonic() + 60.0
    while not look():
        assert time.monotonic() < ends_s, what
        time.sleep(0.002)
