"""Two daemons and their bridges, processes each, into one Tiled server."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from impactd.client import Rig, mm
from tests.simulated_rig import write_simulated_rig

for needed in ("tiled.server", "tiled.client"):
    pytest.importorskip(needed, reason="needs tiled: pip install 'impactd[integrations]'")

pytestmark = [
    pytest.mark.integration,
    pytest.mark.timeout(900),
    pytest.mark.filterwarnings("ignore"),  # Tiled's
]
LIVELINESS_S = 120.0
KEY = "secret"


def until(fine: Callable[[], bool]) -> None:
    """Wait until something is so."""
    ends_s = time.monotonic() + LIVELINESS_S
    while not fine():
        assert time.monotonic() < ends_s, fine
        time.sleep(0.2)


class Program:
    """A program on a port of its own, which can go away and come back."""

    def __init__(self, log: Path, words: list[str], **environment: str) -> None:
        self.log, self._words, self._environment = log, words, {**os.environ, **environment}
        self.start()

    def start(self) -> None:
        """Start it."""
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, "-m", *self._words], stdout=log, stderr=log, env=self._environment
            )

    def end(self, how: signal.Signals = signal.SIGTERM) -> int:
        """End it and return its exit code."""
        self._process.send_signal(how)
        return self._process.wait(60)

    def ended(self) -> bool:
        """Return whether it ended by itself."""
        return self._process.poll() is not None


def free_port() -> int:
    """Return a port that nobody has."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def listens(port: int) -> bool:
    """Return whether somebody answers."""
    with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port)):
        return True
    return False


@pytest.fixture
def programs(tmp_path: Path) -> Iterator[Callable[..., Program]]:
    """Return what starts a program, which is ended with the test."""
    started: list[Program] = []

    def start(name: str, *words: str, **environment: str) -> Program:
        started.append(Program(tmp_path / f"{name}.log", list(words), **environment))
        return started[-1]

    yield start
    for one in started[::-1]:
        if not one.ended():
            one.end()


class Daemon:
    """`impactd serve` on a simulated rig of its own name."""

    def __init__(self, folder: Path, name: str, programs: Callable[..., Program]) -> None:
        self.name, self.folder = name, folder / name
        self.folder.mkdir()
        named = {'name = "simulated': f'name = "{name} simulated'}
        config = write_simulated_rig(self.folder, changes=named)
        self.files = ["--config", str(config), "--data", str(self.folder / "data")]
        words = ["impactd", "token", "create", "--scope", "operate", "--name", name]
        made = subprocess.run(
            [sys.executable, "-m", *words, *self.files], capture_output=True, text=True, check=True
        )
        self.token, port = made.stdout.strip(), free_port()
        self.url = f"http://127.0.0.1:{port}"
        self.program = programs(name, "impactd", "serve", *self.files, "--port", str(port))
        until(lambda: listens(port))
        self.rig = Rig(self.url, self.token, operator="ab")

    def drop(self, sphere: str) -> int:
        """Drop a sphere and return the shot's number."""
        self.rig.wait_until_ready()
        return self.rig.drop(sphere, "aluminium", 30 * mm).number

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        """Run a command for this rig."""
        environment = {**os.environ, "IMPACTD_URL": self.url, "IMPACTD_TOKEN": self.token}
        return subprocess.run(
            [sys.executable, "-m", "impactd", *words],
            env=environment, capture_output=True, text=True, check=False, timeout=LIVELINESS_S,
        )  # fmt: skip


class Lab:
    """Two rigs and a Tiled server that keeps its entries over a restart."""

    def __init__(self, folder: Path, programs: Callable[..., Program]) -> None:
        self._folder, self._programs, self.port = folder, programs, free_port()
        self.rigs = [Daemon(folder, name, programs) for name in ("north", "south")]
        (folder / "key").write_text(KEY)
        words = ["tiled", "serve", "catalog", "--init", str(folder / "catalog.db")]
        words += ["--api-key", KEY, "--port", str(self.port)]
        self.tiled = programs("tiled", *words)
        self.url = f"http://127.0.0.1:{self.port}"
        until(lambda: listens(self.port))

    def words(self, rig: Daemon) -> list[str]:
        """Return the words of a rig's bridge."""
        state = str(self._folder / f"{rig.name}.json")
        key = str(self._folder / "key")
        return ["bridge", "tiled", self.url, "--api-key-file", key, "--state", state]

    def bridge(self, rig: Daemon) -> Program:
        """Start a rig's bridge."""
        environment = {"IMPACTD_URL": rig.url, "IMPACTD_TOKEN": rig.token}
        name = f"bridge-{rig.name}"
        return self._programs(name, "impactd", *self.words(rig), **environment)


def test_two_rigs_share_a_catalogue_that_follows_them_over_outages(
    tmp_path: Path, programs: Callable[..., Program]
) -> None:
    """Every shot is there once, with its rig and newest modulus, whatever was away meanwhile."""
    from tiled.client import from_uri  # noqa: PLC0415 - after the skip
    from tiled.queries import Key  # noqa: PLC0415 - as above

    lab = Lab(tmp_path, programs)
    north, south = lab.rigs
    shots = {(rig, rig.drop("acetal")) for rig in lab.rigs}  # before any bridge
    bridges = {rig: lab.bridge(rig) for rig in lab.rigs}
    catalogue = from_uri(lab.url, api_key=KEY)

    def entry(rig: Daemon, number: int) -> dict:
        return dict(catalogue[f"{rig.name}-simulated-rig-{number:06d}"].metadata)

    def followed() -> bool:
        """Return whether the catalogue says of every shot what its daemon says."""
        try:
            told = {shot: entry(*shot) for shot in shots}
        except KeyError:
            return False
        answers = {(rig, number): rig.rig.shot(number) for rig, number in shots}
        return all(
            told[shot]["reduced_modulus_Pa"] == answer.reduced_modulus_Pa is not None
            and (told[shot]["advice"], told[shot]["sha256"]) == (answer.advice, answer.sha256)
            for shot, answer in answers.items()
        )

    until(followed)

    lab.tiled.end()  # nobody takes anything; one bridge dies too
    bridges[south].end(signal.SIGKILL)
    shots |= {(rig, rig.drop("hdpe")) for rig in lab.rigs}
    lab.tiled.start()
    until(lambda: listens(lab.port))
    bridges[south].start()
    until(followed)
    assert len(catalogue) == 4
    found = catalogue.search(Key("sphere") == "hdpe")
    assert sorted(one.metadata["rig"] for one in found.values()) == sorted(
        f"{rig.name} simulated rig" for rig in lab.rigs
    )

    before = entry(north, 1)["reduced_modulus_Pa"]["value"]
    changed = north.run("materials", "sphere", "acetal", "mass_kg=7e-4+-1e-6", "--note", "weighed")
    assert changed.returncode == 0, changed.stderr
    refitted = north.run("refit", *north.files)
    assert refitted.returncode == 0, refitted.stderr
    until(lambda: entry(north, 1)["reduced_modulus_Pa"]["value"] != before)
    until(followed)

    # begun anew, it changes nothing: neither an entry nor one of its earlier versions
    bridges[north].end()
    key = "north-simulated-rig-000001"
    versions = len(catalogue[key].metadata_revisions[:])
    assert versions
    (tmp_path / "north.json").unlink()
    bridges[north].start()
    until((tmp_path / "north.json").exists)
    assert len(catalogue) == 4
    assert len(catalogue[key].metadata_revisions[:]) == versions

    # who takes the name of another rig is told, and overwrites nothing
    (tmp_path / "south.json").unlink()
    refused = south.run(*lab.words(south), "--name", "north simulated rig")
    assert refused.returncode == 1
    assert "--name" in refused.stderr
    assert not any(bridge.ended() for bridge in bridges.values())
    catalogue.context.http_client.close()
    for rig in lab.rigs:
        rig.rig.close()
