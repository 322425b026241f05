"""A real daemon on the simulated rig, behind a real HTTP server on a free port."""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest

from impactd.daemon import Daemon
from impactd.server import Server, listen, make_server
from impactd.settings.settings import Settings, find_config, load_settings

ACETAL_ON_ALUMINIUM = {
    "sphere": "acetal",
    "surface": "aluminium",
    "drop_height_m": 0.03,
    "operator": "ab",
}
ENDED = ("stored", "analysed", "failed", "aborted", "interrupted")


class Rig:
    """A daemon that answers, and one client per scope."""

    def __init__(self, daemon: Daemon, server: Server) -> None:
        self.daemon = daemon
        self.server = server
        self.url = server.url
        self.anybody = self.client(None)
        self.reader = self.client("read")
        self.operator = self.client("operate")
        self.admin = self.client("admin")

    def token(self, scope: str, name: str | None = None) -> str:
        """Return a fresh token."""
        return self.daemon.archive.tokens.create(name or f"{scope} token", scope, 1)[1]

    def client(self, scope: str | None, name: str | None = None) -> httpx2.Client:
        """Return a client with a fresh token of that scope."""
        headers = {"Authorization": f"Bearer {self.token(scope, name)}"} if scope else {}
        return httpx2.Client(base_url=self.url, headers=headers, timeout=30, trust_env=False)

    def drop(
        self, body: dict[str, object] | None = None, key: str | None = None
    ) -> httpx2.Response:
        """Ask for a drop as the operator."""
        return self.operator.post(
            "/v1/drops",
            json=body or ACETAL_ON_ALUMINIUM,
            headers={"Idempotency-Key": key or str(uuid.uuid4())},
        )

    def ended(self, number: int, states: tuple[str, ...] = ENDED) -> dict[str, object]:
        """Return a drop once it has ended."""
        return until(
            lambda: self.reader.get(f"/v1/drops/{number}").json(),
            lambda drop: drop["state"] in states,
        )

    def analysed_shot(self) -> dict[str, object]:
        """Make a drop and return its shot once it is analysed."""
        number = self.drop().json()["number"]
        drop = self.ended(number, ("analysed", "failed", "aborted", "interrupted"))
        assert drop["state"] == "analysed", drop
        return self.reader.get(f"/v1/shots/{number}").json()

    def close(self) -> None:
        """Close the clients."""
        for client in (self.anybody, self.reader, self.operator, self.admin):
            client.close()


def until(look, fine, limit_s=60.0):
    """Return what `look` returns once it is fine; a liveness limit, not a measurement."""
    end_s = time.monotonic() + limit_s
    while True:
        seen = look()
        if fine(seen):
            return seen
        assert time.monotonic() < end_s, f"still {seen} after {limit_s} s"
        time.sleep(0.02)


def simulated_settings(directory: Path) -> Settings:
    """Return the simulated rig's settings, faster, so that no host is too busy for its drops."""
    settings = load_settings(find_config("simulated.toml"), data=directory)
    assert settings.simulation is not None
    simulation = settings.simulation.model_copy(update={"clock_speed": 4.0})
    return settings.model_copy(update={"simulation": simulation})


def run_daemon(settings: Settings) -> Iterator[Rig]:
    """Serve a daemon from a thread until the caller is done."""
    daemon = Daemon(settings)
    daemon.start()
    server: Server = make_server(daemon)
    thread = threading.Thread(
        target=server.run, kwargs={"sockets": [listen("127.0.0.1", 0)]}, daemon=True
    )
    thread.start()
    until(lambda: server.url, bool)
    rig = Rig(daemon, server)
    try:
        until(lambda: rig.anybody.get("/v1/status").json(), lambda status: status["ready"])
        yield rig
    finally:
        rig.close()
        server.should_exit = True
        thread.join(timeout=30)
        daemon.stop()
        assert not thread.is_alive()


@pytest.fixture(scope="session")
def rig(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
    """Share one daemon among the tests that leave it idle."""
    yield from run_daemon(simulated_settings(tmp_path_factory.mktemp("daemon")))


@pytest.fixture(scope="session")
def shot(rig: Rig) -> dict[str, object]:
    """One stored and analysed shot."""
    return rig.analysed_shot()
