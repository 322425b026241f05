"""A crowd at the port, without a token: an abort is answered, and the log stays short."""

from __future__ import annotations

import socket
import time
from contextlib import ExitStack
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest

from impactd.console.abort_socket import abort_through_socket

from ..storage.daemon_process import DaemonProcess

CROWD = 1200
# What a daemon writes in a minute of its own accord is some dozen lines.
LOG_LIMIT_BYTES = 20_000
SAID = {
    "nothing": b"",
    "half a header": b"POST /v1/abort HTTP/1.1\r\nHost: 127.0.0.1\r\n",
    "half a body": b"POST /v1/drops HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    b"Content-Type: application/json\r\nContent-Length: 100\r\n\r\n{",
    "no http": b"\x16\x03\x01\r\n\r\n",
    "a slow reader": b"GET /openapi.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n" * 10,
}


def _crowd(url: str, said: bytes, count: int, held: ExitStack) -> None:
    """Open so many connections and leave them; one that was closed meanwhile is as good."""
    parts = urlsplit(url)
    for _ in range(count):
        client = held.enter_context(socket.create_connection((parts.hostname, parts.port), 30))
        try:
            client.sendall(said)
        except OSError:
            continue


def _aborts(daemon: DaemonProcess) -> list[float]:
    """Abort three times over HTTP and three times through the socket; return the times. [s]"""
    times = []
    for _ in range(3):
        began_s = time.monotonic()
        with httpx2.Client(
            base_url=daemon.url, headers=daemon._headers, timeout=30, trust_env=False
        ) as client:
            assert client.post("/v1/abort").status_code == 200
        times.append(time.monotonic() - began_s)
        began_s = time.monotonic()
        assert abort_through_socket(daemon.url, "ab") is not None
        times.append(time.monotonic() - began_s)
    return times


@pytest.mark.slow
@pytest.mark.parametrize("said", SAID.values(), ids=SAID)
def test_a_crowd_keeps_no_abort_out(tmp_path: Path, said: bytes) -> None:
    """1200 connections that are held, and come again: each abort is answered, both ways."""
    with DaemonProcess(tmp_path) as daemon:
        daemon.start()
        alone = _aborts(daemon)
        before = daemon.log.stat().st_size
        with ExitStack() as held:
            _crowd(daemon.url, said, CROWD, held)
            among = _aborts(daemon)
            for _ in range(3):
                _crowd(daemon.url, said, 100, held)
                among += _aborts(daemon)
            grown = daemon.log.stat().st_size - before
        for way, start in (("HTTP", 0), ("the socket", 1)):
            quiet, crowded = max(alone[start::2]) * 1e3, max(among[start::2]) * 1e3
            print(f"abort over {way}: alone {quiet:.0f} ms, in the crowd {crowded:.0f} ms at most")
        print(f"the log grew by {grown} bytes")
        assert grown < LOG_LIMIT_BYTES, daemon.log.read_text()[-2000:]
        assert daemon.get("/v1/status")["ready"]
        assert daemon.stop() == 0
