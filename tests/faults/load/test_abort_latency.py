"""How long an abort takes, from the client's first byte to "safe", whatever else goes on.

Each condition is laid beside an idle abort of the same daemon in the same run.
"""

from __future__ import annotations

import http.client
import json
import multiprocessing
import socket
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from multiprocessing.synchronize import Event
from pathlib import Path
from statistics import median
from urllib.parse import urlsplit

import pytest

from impactd.bench.large_archive import fill_archive, fitted_shots
from impactd.console.abort_socket import abort_through_socket
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config, load_settings

from ..conftest import Disk
from ..storage.daemon_process import DaemonProcess

ABORTS = 200
CROWD = 1200
READERS = 4
SHOTS = 10_000
HALF_A_HEADER = b"POST /v1/abort HTTP/1.1\r\nHost: 127.0.0.1\r\n"

Condition = Callable[[DaemonProcess], AbstractContextManager[None]]


def _over_http(daemon: DaemonProcess) -> None:
    parts = urlsplit(daemon.url)
    with closing(http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=60)) as one:
        one.request("POST", "/v1/abort", headers=daemon._headers)
        answer = one.getresponse()
        said = json.loads(answer.read())
    assert answer.status == 200, said
    assert "The vacuum is on" in said["sentence"], said


def _through_the_socket(daemon: DaemonProcess) -> None:
    said = abort_through_socket(daemon.url, "ab")
    assert said is not None
    assert "The vacuum is on" in said["sentence"], said


def _times_s(ask: Callable[[DaemonProcess], None], daemon: DaemonProcess) -> list[float]:
    times = []
    for _ in range(ABORTS):
        began_s = time.perf_counter()
        ask(daemon)
        times.append(time.perf_counter() - began_s)
        time.sleep(0.005)  # a person is no flood
    return sorted(times)


@contextmanager
def _crowd(daemon: DaemonProcess) -> Iterator[None]:
    """Hold 1200 connections with half a request, and come again when they are closed."""
    parts = urlsplit(daemon.url)
    with ExitStack() as held:
        for _ in range(CROWD):
            one = held.enter_context(socket.create_connection((parts.hostname, parts.port), 30))
            try:
                one.sendall(HALF_A_HEADER)
            except OSError:
                continue
        yield


@contextmanager
def _locked_index(daemon: DaemonProcess) -> Iterator[None]:
    path = daemon.data / "index.sqlite"
    with closing(sqlite3.connect(path, isolation_level=None, timeout=30)) as other:
        other.execute("BEGIN IMMEDIATE")
        yield


@contextmanager
def _readers(daemon: DaemonProcess) -> Iterator[None]:
    """Let four processes ask for the moduli of a large archive without a pause."""
    context = multiprocessing.get_context("spawn")
    end = context.Event()
    with ExitStack() as stack:
        for _ in range(READERS):
            begun = context.Event()
            reader = context.Process(
                target=_read, args=(daemon.url, daemon._headers, begun, end), daemon=True
            )
            reader.start()
            stack.callback(reader.join)
            assert begun.wait(300)
        stack.callback(end.set)
        yield


def _read(url: str, headers: dict[str, str], begun: Event, end: Event) -> None:
    parts = urlsplit(url)
    with closing(http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=300)) as one:
        while not end.is_set():
            one.request("GET", "/v1/moduli", headers=headers)
            assert len(one.getresponse().read()) > 1000
            begun.set()


def _measure(daemon: DaemonProcess, condition: Condition, name: str) -> None:
    daemon.start()
    ways = {"HTTP": _over_http, "socket": _through_the_socket}
    idle = {way: _times_s(ask, daemon) for way, ask in ways.items()}
    with condition(daemon):
        busy = {way: _times_s(ask, daemon) for way, ask in ways.items()}
    for way in ways:
        tail, reference = busy[way][ABORTS * 99 // 100 - 1], idle[way][ABORTS * 99 // 100 - 1]
        print(
            f"{name}, {way}: p99 {tail * 1e3:.0f} ms (idle {reference * 1e3:.0f} ms, "
            f"{tail / reference:.1f} times), median {median(busy[way]) * 1e3:.1f} ms "
            f"(idle {median(idle[way]) * 1e3:.1f} ms, "
            f"{median(busy[way]) / median(idle[way]):.1f} times)"
        )


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("condition", "name"),
    [(_crowd, "1200 half requests"), (_locked_index, "locked index")],
    ids=["crowd", "locked index"],
)
def test_an_abort_beside_strangers_and_locks(
    tmp_path: Path, condition: Condition, name: str
) -> None:
    """Every abort is answered with the vacuum on; the times are printed beside idle ones."""
    with DaemonProcess(tmp_path) as daemon:
        _measure(daemon, condition, name)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_an_abort_on_a_full_disk(tmp_path: Path, disk: Disk) -> None:
    """The disk has no page left as the button is pressed."""

    @contextmanager
    def full(_daemon: DaemonProcess) -> Iterator[None]:
        disk.leave(0)
        yield
        disk.leave(16 * 1024 * 1024)

    no_reserve = {"reserve_bytes = 200_000_000": "reserve_bytes = 0"}
    with DaemonProcess(tmp_path, data=disk.path / "data", changes=no_reserve) as daemon:
        _measure(daemon, full, "full disk")


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_an_abort_beside_four_readers_of_a_large_archive(tmp_path: Path) -> None:
    """Four processes read the moduli of 10 000 shots meanwhile."""
    settings = load_settings(find_config("simulated.toml"))
    templates = fitted_shots(settings, load_materials(settings.materials.file))
    with DaemonProcess(tmp_path) as daemon:
        fill_archive(daemon.data, templates, SHOTS)
        _measure(daemon, _readers, f"four readers at {SHOTS} shots")
