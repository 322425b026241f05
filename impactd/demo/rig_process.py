"""The daemon of the demo: `impactd serve` on a simulated rig, as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import tomllib
from pathlib import Path
from types import TracebackType
from typing import Any

from impactd.client.connection import Connection
from impactd.console.failure import Failure
from impactd.data_lock import read_holder
from impactd.demo.drops import REFERENCE_SURFACES, SPHERES, SURFACES
from impactd.settings.settings import find_config

MATERIALS_NAME = "materials.toml"
CLOCK_SPEED = 4.0
"""Rig seconds per host second: quick, and slow enough to see each drop."""
TRIGGER = {"level_v": 0.3, "hysteresis_v": 0.05}
NOISE_MAX_V = 0.15
"""As a technician would set both where the input hums as much as any rig that may be drawn: its
smallest pulses have 1.7 V."""

_START_LIMIT_S = 90.0
_STOP_LIMIT_S = 20.0


def write_settings(file: Path, *, seed: int, effect: str) -> None:
    """Write the settings of the demo's rig: the shipped simulated rig, quicker and with a secret.

    Its drawers hold the materials of the demo and no others: a secret that acts on one material
    only shall be one that the demo drops.

    Parameters
    ----------
    file : Path
        Where to; the materials go beside it.
    seed : int
        Seed of everything the simulated rig draws.
    effect : str
        What the instrument hides: an effect's id, ``random`` or ``none``.
    """
    shipped = find_config("simulated.toml")
    settings = tomllib.loads(shipped.read_text(encoding="utf-8"))
    drawers = file.with_name(MATERIALS_NAME)
    _write_materials(find_config(settings["materials"]["file"]), drawers)
    settings["materials"]["file"] = str(drawers.resolve())
    settings["trigger"] |= TRIGGER
    settings["preflight"]["noise_max_v"] = NOISE_MAX_V
    settings["simulation"] |= {"seed": seed, "effect": effect, "clock_speed": CLOCK_SPEED}
    _write(file, f"The rig of one `impactd demo`; derived from {shipped.name}.", settings)


def _write_materials(shipped: Path, file: Path) -> None:
    """Write the materials that the demo drops, as they are shipped."""
    known = tomllib.loads(shipped.read_text(encoding="utf-8"))
    wanted = {"sphere": SPHERES, "surface": (*SURFACES, *REFERENCE_SURFACES)}
    kept = {
        f"{group}.{name}": known[group][name] for group, names in wanted.items() for name in names
    }
    _write(file, f"The materials of one `impactd demo`; from {shipped.name}.", kept)


def _write(file: Path, about: str, sections: dict[str, Any]) -> None:
    lines = [f"# {about}", ""]
    for section, keys in sections.items():
        lines.append(f"[{section}]")
        lines += [f"{key} = {_toml(value)}" for key, value in keys.items()]
        lines.append("")
    file.write_text("\n".join(lines), encoding="utf-8")


def _toml(value: Any) -> str:
    """Write one value as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {_toml(item)}" for key, item in value.items()) + " }"
    return repr(value)


class RigProcess:
    """A running daemon; leaving the ``with`` block stops it.

    Parameters
    ----------
    log : Path
        File that gets what it says.

    Raises
    ------
    Failure
        If it does not answer within 90 s, with the last line of its log.
    """

    def __init__(self, settings: Path, data: Path, log: Path) -> None:
        self._own_files = ["--config", str(settings), "--data", str(data)]
        self._data = data
        self._log = log
        with log.open("wb") as sink:
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and words
                self._command("serve", "--host", "127.0.0.1", "--port", "0"),
                stdin=subprocess.DEVNULL,
                stdout=sink,
                stderr=sink,
                # a Ctrl-C in the terminal is for the demo, which then stops its daemon in order
                start_new_session=True,
            )

    def __enter__(self) -> RigProcess:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def connect(self) -> Connection:
        """Wait until the daemon is ready to drop, and return a client with a token of its own.

        Returns
        -------
        Connection
            Allowed to administrate: choosing the active model is an administrator's.
        """
        url = self._wait_for_url()
        token = subprocess.run(  # noqa: S603 - as above
            self._command("token", "create", "--scope", "admin", "--name", "demo"),
            capture_output=True,
            text=True,
            check=False,
        )
        if token.returncode:
            raise Failure(f"the demo got no token: {token.stderr.strip()}")
        client = Connection(url, token.stdout.strip())
        self._wait_until_ready(client)
        return client

    def stop(self) -> None:
        """End the daemon as systemd would; kill it only if it does not listen."""
        if self._process.poll() is not None:
            return
        self._process.terminate()
        try:
            self._process.wait(_STOP_LIMIT_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _command(self, *words: str) -> list[str]:
        return [sys.executable, "-m", "impactd", *words, *self._own_files]

    def _wait_for_url(self) -> str:
        deadline = time.monotonic() + _START_LIMIT_S
        while time.monotonic() < deadline:
            self._check_alive()
            holder = read_holder(self._data)
            if holder.get("pid") == self._process.pid and holder.get("url"):
                return str(holder["url"])
            time.sleep(0.05)
        raise Failure(f"the daemon did not listen within {_START_LIMIT_S:g} s; see {self._log}.")

    def _wait_until_ready(self, client: Connection) -> None:
        deadline = time.monotonic() + _START_LIMIT_S
        status: dict[str, Any] = {"sentence": "it gave no output"}
        while time.monotonic() < deadline:
            self._check_alive()
            status = client.get("/v1/status")
            if status["ready"]:
                return
            time.sleep(0.1)
        raise Failure(f"the simulated rig did not become ready: {status['sentence']}")

    def _check_alive(self) -> None:
        if self._process.poll() is not None:
            said = self._log.read_text(encoding="utf-8", errors="replace").splitlines()
            last = said[-1].removeprefix("impactd: ") if said else "it said nothing"
            raise Failure(
                f"the daemon ended by itself with code {self._process.returncode}: "
                f"{last} (all of it: {os.fspath(self._log)})"
            )
