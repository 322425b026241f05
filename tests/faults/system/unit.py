"""The daemon as a unit of systemd, and a client of it; for the cases inside the container."""

from __future__ import annotations

import shutil
import subprocess
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx2

from impactd.settings.sections import StorageSection
from impactd.settings.settings import find_config

NAME = "impactd.service"
DATA = Path("/var/lib/impactd")
SETTINGS = Path("/etc/impactd/impactd.toml")
DROP_INS = Path("/run/systemd/system/impactd.service.d")
PROGRAM = "/opt/impactd/bin/impactd"
URL = "http://127.0.0.1:8642"
DROP = {"sphere": "acetal", "surface": "aluminium", "drop_height_m": 0.03, "operator": "ab"}
ENDED = ("stored", "analysed", "failed", "aborted", "interrupted")
# Only a liveness limit: what a case promises is checked against its own figures.
PATIENCE_S = 120.0


class CannotRunError(Exception):
    """A case cannot run on this machine; the reason is its message."""


def run(*command: str) -> str:
    """Run a command that must succeed; return what it printed."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, f"{' '.join(command)}: {done.stderr.strip() or done.stdout}"
    return done.stdout.strip()


def until(look: Callable[[], Any], what: str, every_s: float = 0.02) -> Any:
    """Wait until something is so; return it."""
    ends_s = time.monotonic() + PATIENCE_S
    while not (found := look()):
        assert time.monotonic() < ends_s, f"{what}, not within {PATIENCE_S:g} s"
        time.sleep(every_s)
    return found


class Unit:
    """impactd.service with a fresh archive and the settings of the simulated rig."""

    def __init__(self) -> None:
        self._secret = ""
        self.client = httpx2.Client(base_url=URL, timeout=30, trust_env=False)

    def configure(self, *, board_port: str | None = None, **changes: str) -> None:
        """Write the settings: of the simulated rig, keys replaced or added by `section__key`.

        Parameters
        ----------
        board_port : str, optional
            Where the relay board is that `impactd make-safe` is to find. The daemon gets the
            simulated rig in a file of its own then.
        **changes : str
            Values as TOML.
        """
        simulated = find_config("simulated.toml").read_text()
        if "rescue_directory" in StorageSection.model_fields:
            changes.setdefault("storage__rescue_directory", '"/srv/impactd-rescue"')
        for name, value in changes.items():
            section, key = name.split("__")
            kept = [line for line in simulated.splitlines() if not line.startswith(f"{key} = ")]
            kept.insert(kept.index(f"[{section}]") + 1, f"{key} = {value}")
            simulated = "\n".join(kept) + "\n"
        if board_port is None:
            SETTINGS.write_text(simulated)
            return
        (SETTINGS.parent / "simulated.toml").write_text(simulated)
        real = simulated.partition("[simulation]")[0]
        SETTINGS.write_text(real.replace("[valve]\n", f'[valve]\nport = "{board_port}"\n'))

    def drop_in(self, text: str) -> None:
        """Change the shipped unit, as little as a case needs."""
        DROP_INS.mkdir(parents=True, exist_ok=True)
        (DROP_INS / "case.conf").write_text(text)
        run("systemctl", "daemon-reload")

    def start(self) -> float:
        """Start the unit and wait for READY; return how long it took. [s]"""
        began_s = time.monotonic()
        run("systemctl", "start", NAME)
        if not self._secret:
            options = ["--scope", "operate", "--name", "case", "--config", str(SETTINGS)]
            self._secret = run(
                *("runuser", "-u", "impactd", "--", PROGRAM, "token", "create"),
                *options,
                *("--data", str(DATA)),
            ).splitlines()[-1]
            self.client.headers["Authorization"] = f"Bearer {self._secret}"
        self.wait_ready()
        return time.monotonic() - began_s

    def wait_ready(self) -> None:
        """Wait for the green light."""
        until(self._ready, "the rig is not ready")

    def _ready(self) -> bool:
        try:
            return bool(self.get("/v1/status")["ready"])
        except httpx2.TransportError:
            return False

    def get(self, path: str) -> dict[str, Any]:
        """Return the JSON of a resource."""
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        found: dict[str, Any] = answer.json()
        return found

    def drop(self) -> int:
        """Ask for a drop; return its number."""
        key = {"Idempotency-Key": str(uuid.uuid4())}
        answer = self.client.post("/v1/drops", json=DROP, headers=key)
        assert answer.status_code == 202, answer.text
        return int(answer.json()["number"])

    def ended(self, number: int) -> dict[str, Any]:
        """Wait for the end of a drop; return it."""
        drop: dict[str, Any] = until(
            lambda: (d := self.get(f"/v1/drops/{number}"))["state"] in ENDED and d,
            f"drop {number} does not end",
        )
        return drop

    def show(self, name: str) -> str:
        """Return a property of the unit."""
        return run("systemctl", "show", "--property", name, "--value", NAME)

    def began_s(self) -> float:
        """Return when the present main process was started, on the monotonic clock. [s]"""
        return int(self.show("ExecMainStartTimestampMonotonic")) / 1e6

    def signal(self, name: str) -> float:
        """Send a signal to the main process; return when. [s]"""
        run("systemctl", "kill", f"--signal={name}", "--kill-who=main", NAME)
        return time.monotonic()

    def log(self) -> str:
        """Return the end of the unit's log."""
        command = ["journalctl", "--unit", NAME, "--lines", "40", "--no-pager", "--output", "cat"]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    def said(self, words: str) -> list[str]:
        """Return the log's lines with these words, since the machine came up."""
        lines = run("journalctl", "--unit", NAME, "--no-pager", "--output", "cat").splitlines()
        return [line for line in lines if words in line]

    def reset(self) -> None:
        """Stop the unit; take the archive and every change away."""
        subprocess.run(["systemctl", "stop", NAME], check=False, capture_output=True)
        subprocess.run(["systemctl", "reset-failed", NAME], check=False, capture_output=True)
        self.client.close()
        shutil.rmtree(DROP_INS, ignore_errors=True)
        for left in DATA.iterdir() if DATA.exists() else ():
            shutil.rmtree(left) if left.is_dir() else left.unlink()
        run("systemctl", "daemon-reload")


def memory_is_bounded() -> bool:
    """Tell whether systemd can bound a unit's memory here: the controller must be delegated."""
    controllers = Path("/sys/fs/cgroup/cgroup.controllers")
    return controllers.exists() and "memory" in controllers.read_text().split()
