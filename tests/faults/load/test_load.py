"""Slow readers and a busy page during drops: status stays quick and no sample is lost."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import time
import uuid
from pathlib import Path
from subprocess import PIPE

import numpy as np
import pytest

from ..storage.daemon_process import DROP, ENDED, DaemonProcess, until

# The promises are 50 ms for a status and 100 ms for an abort. Machines that run tests are noisy:
# what one needs for a bare answer, asked in the same way at the same time, comes on top.
P99_LIMIT_S = 0.05
ABORT_LIMIT_S = 0.1
SLOW_CLIENTS = 20
HERE = Path(__file__).parent


def _slow_client(daemon: DaemonProcess, path: str) -> socket.socket:
    """Ask for something long and read none of it: the smallest window there is."""
    host, port = daemon.url.removeprefix("http://").split(":")
    connection = socket.socket()
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    connection.connect((host, int(port)))
    token = daemon._headers["Authorization"]
    connection.sendall(
        f"GET {path} HTTP/1.1\r\nHost: {host}\r\nAuthorization: {token}\r\n\r\n".encode()
    )
    return connection


def _read_slowly(connections: list[socket.socket]) -> None:
    for connection in connections:
        connection.setblocking(False)
        try:
            connection.recv(256)
        except BlockingIOError:
            continue


def _abort(daemon: DaemonProcess) -> float:
    """Ask for a drop and abort it at once; return how long the abort took. [s]"""
    assert daemon.client is not None
    until(lambda: daemon.get("/v1/status"), lambda status: status["ready"])
    number = daemon.post("/v1/drops", DROP, str(uuid.uuid4())).json()["number"]
    began_s = time.perf_counter()
    assert daemon.client.post("/v1/abort").status_code == 200
    took_s = time.perf_counter() - began_s
    until(lambda: daemon.get(f"/v1/drops/{number}"), lambda drop: drop["state"] in ENDED)
    return took_s


def _load(folder: Path, drops: int, seconds: float) -> None:
    daemon = DaemonProcess(folder, clock_speed="1.0")
    daemon.start()
    try:
        first = daemon.post("/v1/drops", DROP, str(uuid.uuid4())).json()["number"]
        until(lambda: daemon.get(f"/v1/drops/{first}"), lambda drop: drop["state"] in ENDED)
        assert daemon.get(f"/v1/drops/{first}")["shot"] == first
        slow = [_slow_client(daemon, "/v1/events?after=0") for _ in range(SLOW_CLIENTS // 2)]
        slow += [_slow_client(daemon, "/v1/shots/1.h5") for _ in range(SLOW_CLIENTS // 2)]
        bare = subprocess.Popen([sys.executable, str(HERE / "bare_server.py")], stdout=PIPE)
        assert bare.stdout is not None
        bare_url = bare.stdout.readline().decode().strip()
        asking, asking_bare = (
            subprocess.Popen([sys.executable, str(HERE / "ask_status.py"), *of], stdout=PIPE)
            for of in ((daemon.url, str(seconds)), (bare_url, str(seconds)))
        )
        numbers = []
        for _ in range(drops):
            until(lambda: daemon.get("/v1/status"), lambda status: status["ready"])
            asked = daemon.post("/v1/drops", DROP, str(uuid.uuid4()))
            assert asked.status_code == 202, asked.text
            numbers.append(asked.json()["number"])
            while daemon.get(f"/v1/drops/{numbers[-1]}")["state"] not in (
                *("stored", "analysed", "failed"),
            ):
                _read_slowly(slow)
                time.sleep(0.1)
        abort_s = [_abort(daemon) for _ in range(3)]
        took_s, bare_s = (
            np.array(json.loads(one.communicate(timeout=seconds + 120)[0])["took_s"])
            for one in (asking, asking_bare)
        )
        bare.kill()
        bare.communicate()
        ended = [daemon.get(f"/v1/drops/{number}") for number in numbers]
        for connection in slow:
            connection.close()
    finally:
        daemon.stop()
    whole = sum(drop["shot"] is not None for drop in ended)
    p99_s, bare_p99_s = (float(np.quantile(one, 0.99)) for one in (took_s, bare_s))
    print(
        f"{SLOW_CLIENTS} slow clients, {took_s.size} status requests at "
        f"{took_s.size / seconds:.0f}/s: p50 {np.median(took_s) * 1e3:.1f} ms, p99 "
        f"{p99_s * 1e3:.1f} ms, max {took_s.max() * 1e3:.0f} ms; a bare answer of this host: "
        f"p50 {np.median(bare_s) * 1e3:.1f} ms, p99 {bare_p99_s * 1e3:.1f} ms, max "
        f"{bare_s.max() * 1e3:.0f} ms; {whole} of {drops} drops whole; "
        f"slowest abort {max(abort_s) * 1e3:.0f} ms"
    )
    assert whole == drops, [drop["problem"] for drop in ended]
    assert p99_s < P99_LIMIT_S + 2 * bare_p99_s
    assert max(abort_s) < ABORT_LIMIT_S + 4 * bare_s.max()


@pytest.mark.slow
def test_slow_readers_and_a_busy_page_lose_no_sample(tmp_path: Path) -> None:
    """Twenty readers that do not read and fifty status requests a second, during a drop."""
    _load(tmp_path, 1, 4.0)


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_minute_of_load_loses_no_sample(tmp_path: Path) -> None:
    """The same for a minute and twenty drops."""
    _load(tmp_path, 20, 60.0)
