"""Every signal that ends the daemon ends it with the valve closed, whenever it arrives."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import httpx2
import pytest

from impactd.settings.settings import find_config

from .supervisor import DROP, Supervisor, until

SIGNALS = [signal.SIGHUP, signal.SIGTERM, signal.SIGINT]


@pytest.mark.parametrize(
    "number", [signal.SIGHUP, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)]
)
def test_a_signal_ends_the_daemon_with_the_valve_closed(tmp_path: Path, number: int) -> None:
    """Sent with the sphere just released: the vacuum is on again, and the end is an orderly one."""
    supervisor = Supervisor(tmp_path, watchdog_s=60.0, abort_s=0.2, pause_s=0.1)
    try:
        supervisor.start()
        with httpx2.Client(
            base_url=supervisor.url, headers=supervisor.headers, timeout=30, trust_env=False
        ) as client:
            until(lambda: client.get("/v1/status").json()["ready"], "never ready")
            supervisor.world.load("acetal", "aluminium", 0.03)
            key = {"Idempotency-Key": str(uuid.uuid4())}
            assert client.post("/v1/drops", json=DROP, headers=key).status_code == 202
        until(lambda: supervisor.board.relay_on, "the valve never opened")
        supervisor.process.send_signal(number)
        assert supervisor.process.wait(60) == 0
        assert not supervisor.board.relay_on
    finally:
        supervisor.end()


_EARLY = """
import os, signal, sys
from impactd.daemon import Daemon

start = Daemon.start

def start_and_be_told(daemon):
    {before}
    start(daemon)
    {after}

Daemon.start = start_and_be_told
from impactd.cli import main
main()
"""


@pytest.mark.parametrize(
    ("number", "moment"),
    [
        pytest.param(number, moment, id=f"{number.name} {moment}", marks=marks)
        for number in SIGNALS
        for moment, marks in (
            ("before", pytest.mark.slow),
            ("after", () if number is signal.SIGHUP else pytest.mark.slow),
        )
    ],
)
def test_a_signal_before_the_web_server_is_not_lost(
    tmp_path: Path, number: signal.Signals, moment: str
) -> None:
    """Sent while the devices are being opened: the daemon ends, as it would a second later."""
    script = {"before": "pass", "after": "pass"}
    script[moment] = f"os.kill(os.getpid(), {int(number)})"
    places = ["--config", str(find_config("simulated.toml")), "--data", str(tmp_path / "data")]
    ended = subprocess.run(
        [sys.executable, "-c", _EARLY.format(**script), "serve", "--port", "0", *places],
        env=os.environ,
        capture_output=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr.decode()
