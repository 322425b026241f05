"""systemd hears what the daemon says, over a real datagram socket."""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from impactd.sd_notify import notify, watchdog_interval_s


@pytest.fixture(params=["path", "abstract"])
def listener(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[socket.socket]:
    """Listen as systemd would, on both kinds of socket it uses."""
    name = str(tmp_path / "notify") if request.param == "path" else f"@{secrets.token_hex(8)}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(name.replace("@", "\0", 1) if name.startswith("@") else name)
        receiver.settimeout(5.0)
        monkeypatch.setenv("NOTIFY_SOCKET", name)
        yield receiver


def test_a_notification_arrives_as_one_datagram_of_lines(listener: socket.socket) -> None:
    """All fields of one call travel together, upper-case, in their order."""
    assert notify(ready="1", status="READY: hang the acetal sphere")
    assert listener.recv(4096) == b"READY=1\nSTATUS=READY: hang the acetal sphere"


def test_a_line_break_in_a_status_cannot_make_a_field(listener: socket.socket) -> None:
    """A status with a line break stays one field, so no message can pretend to be another."""
    assert notify(status="disk full\nREADY=1")
    assert listener.recv(4096) == b"STATUS=disk full READY=1"


@pytest.mark.parametrize("address", ["", "relative/path", "/nobody/listens/here"])
def test_without_a_listener_nothing_happens(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Outside systemd, or where the socket is gone, the daemon carries on."""
    monkeypatch.setenv("NOTIFY_SOCKET", address)
    assert not notify(ready="1")


def test_a_listener_that_hangs_is_not_waited_for(listener: socket.socket) -> None:
    """Its queue is full: the daemon goes on."""
    told = [notify(watchdog="1") for _ in range(2000)]
    assert told[0]
    assert not told[-1]
    listener.recv(4096)
    assert notify(stopping="1")


def test_the_watchdog_is_fed_at_half_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """systemd's limit of 30 s asks for a sign of life every 15 s."""
    monkeypatch.setenv("WATCHDOG_USEC", "30000000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))
    assert watchdog_interval_s() == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("limit_us", "pid"), [("", ""), ("0", ""), ("soon", ""), ("30000000", "1")]
)
def test_no_watchdog_waits_for_this_process(
    limit_us: str, pid: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A missing limit, or one meant for another process, asks for nothing."""
    monkeypatch.setenv("WATCHDOG_USEC", limit_us)
    monkeypatch.setenv("WATCHDOG_PID", pid)
    assert watchdog_interval_s() is None
