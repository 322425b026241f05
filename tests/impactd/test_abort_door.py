"""The abort socket: an abort for whoever may open it, whatever the rest does."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import stat
import threading
from pathlib import Path

import pytest
import structlog.testing

from impactd.abort_door import AbortDoor, socket_name
from impactd.acquisition.abort_epoch import AbortEpoch
from impactd.acquisition.reservation import AbortReport
from impactd.api.arrivals import Arrivals
from impactd.console.abort_socket import abort_through_socket

PORT = 65000


class Service:
    """Stands for the acquisition, which `test_abort.py` has: notes who aborted."""

    def __init__(self) -> None:
        self.by: list[str] = []
        self.go_on = threading.Event()
        self.go_on.set()

    def abort(self, *, by: str) -> AbortReport:
        """Note it."""
        assert self.go_on.wait(30)
        self.by.append(by)
        return AbortReport(True, 17, "Drop 17 is ended.", 0.0)


@pytest.fixture
def runtime(tmp_path, monkeypatch) -> Path:
    """A runtime directory of this test's own."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    return tmp_path / "impactd"


@pytest.fixture
def door(runtime):
    """An open door."""
    service = Service()
    with AbortDoor(service, Arrivals(AbortEpoch()), PORT) as opened:
        opened.service = service
        yield opened


def _connect(door: AbortDoor) -> socket.socket:
    client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    client.settimeout(30)
    client.connect(str(door.path))
    return client


def _read(client: socket.socket) -> bytes:
    with client.makefile("rb") as reader:
        return reader.readline()


def test_one_line_aborts(door):
    """The answer is one line of JSON; the record names who said so, and with which uid."""
    with _connect(door) as client:
        client.sendall(b"abort ab\n")
        answer = json.loads(_read(client))
    assert (answer["aborted"], answer["drop"]) == (True, 17)
    assert answer["sentence"] == "Drop 17 is ended."
    assert 0 <= answer["took_ms"] <= answer["safe_after_ms"]
    assert door.service.by == [f"ab (uid {os.geteuid()})"]


def test_the_socket_is_for_its_owner_and_group(door, runtime):
    """Nobody else may open it, or look into its folder."""
    assert door.path == runtime / socket_name(PORT)
    assert stat.S_IMODE(door.path.stat().st_mode) == 0o660
    assert stat.S_IMODE(runtime.stat().st_mode) == 0o700


def test_the_system_folder_comes_first(tmp_path, monkeypatch):
    """Under systemd the socket is where the unit's RuntimeDirectory is."""
    monkeypatch.setenv("RUNTIME_DIRECTORY", f"{tmp_path}:/nowhere")
    with AbortDoor(Service(), Arrivals(AbortEpoch()), PORT) as opened:
        assert opened.path == tmp_path / socket_name(PORT)
    assert not opened.path.exists()


@pytest.mark.parametrize(
    "said", [b"hello\n", b"\n", b"abortion ab\n", b"\xff" * 300, b"GET / HTTP/1.1\r\n"]
)
def test_anything_else_is_answered_with_a_hint(door, said):
    """No other word does anything."""
    with _connect(door) as client:
        client.sendall(said)
        assert b"abort NAME" in _read(client)
    assert door.service.by == []


@pytest.mark.parametrize("name", ["", "\x1b[31mred\x07", "\u202eab", "x" * 200])
def test_a_name_is_printable_and_short(door, name):
    """Whatever somebody calls himself, the record can be read."""
    with _connect(door) as client:
        client.sendall(f"abort {name}\n".encode())
        assert json.loads(_read(client))["aborted"]
    assert door.service.by[0].isprintable()
    assert len(door.service.by[0]) < 100


def test_silent_visitors_keep_no_abort_out(door):
    """Forty connections that say half a word, and one that aborts."""
    with contextlib.ExitStack() as held:
        for _ in range(40):
            held.enter_context(_connect(door)).sendall(b"abo")
        client = held.enter_context(_connect(door))
        client.sendall(b"abort ab\n")
        assert json.loads(_read(client))["aborted"]


def test_a_silent_visitor_is_closed(door):
    """After a second, so that the threads of the door serve others."""
    with _connect(door) as client:
        assert client.recv(10) == b""


def test_aborts_do_not_wait_for_each_other(door):
    """One that hangs holds its own thread only."""
    door.service.go_on.clear()
    with _connect(door) as first, _connect(door) as second:
        for client in (first, second):
            client.sendall(b"abort ab\n")
        door.service.go_on.set()
        assert all(json.loads(_read(client))["aborted"] for client in (first, second))


def test_a_dead_socket_is_replaced_and_a_living_one_is_not(runtime, door):
    """A killed daemon's file is in nobody's way; another daemon's door stays open."""
    with structlog.testing.capture_logs() as lines:
        second = AbortDoor(Service(), Arrivals(AbortEpoch()), PORT)
        second.start()
        taken = second.path
        second.stop()
    assert taken != door.path
    assert "another daemon answers" in str(lines[0])
    assert abort_through_socket(f"http://127.0.0.1:{PORT}", "ab")["drop"] == 17
    dead = runtime / socket_name(PORT + 1)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as killed:
        killed.bind(str(dead))
    with AbortDoor(Service(), Arrivals(AbortEpoch()), PORT + 1) as opened:
        assert opened.path == dead


def test_a_folder_of_somebody_else_is_not_used(runtime, monkeypatch):
    """A runtime folder that others may write to is passed over."""
    runtime.mkdir()
    runtime.chmod(0o777)
    with AbortDoor(Service(), Arrivals(AbortEpoch()), PORT) as opened:
        assert opened.path.parent != runtime


@pytest.mark.parametrize(
    "url", ["http://192.0.2.1:8642", "https://127.0.0.1:65000", "x", "http://[", ""]
)
def test_only_an_address_on_this_machine_has_a_socket(door, url):
    """Elsewhere it would be somebody else's rig."""
    assert abort_through_socket(url, "ab") is None
    assert door.service.by == []


def test_no_socket_means_the_other_way(runtime):
    """Without a daemon there is no answer, and no error either."""
    assert abort_through_socket(f"http://localhost:{PORT}", "ab") is None
