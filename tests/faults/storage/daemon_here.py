"""A daemon behind a real HTTP server, in a thread of the test: its rig can be looked into."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx2

from drivers.simulated.world import World
from impactd.daemon import Daemon
from impactd.server import listen, make_server
from impactd.settings.settings import find_config, load_settings

from .daemon_process import DROP, until


class DaemonHere:
    """The daemon, its world, and a client."""

    def __init__(self, daemon: Daemon, url: str, secret: str | None) -> None:
        self.daemon = daemon
        assert daemon.rig.world is not None
        self.world: World = daemon.rig.world
        self.secret = secret or daemon.archive.tokens.create("tester", "operate")[1]
        self.client = httpx2.Client(
            base_url=url,
            headers={"Authorization": f"Bearer {self.secret}"},
            timeout=30,
            trust_env=False,
        )

    def get(self, path: str) -> dict[str, Any]:
        """Return the JSON of a resource."""
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def drop(self, key: str) -> httpx2.Response:
        """Ask for a drop."""
        return self.client.post("/v1/drops", json=DROP, headers={"Idempotency-Key": key})

    def ready(self) -> None:
        """Wait until the rig is ready."""
        until(lambda: self.get("/v1/status"), lambda status: status["ready"])


@contextmanager
def daemon_here(
    data: Path,
    before: Callable[[Daemon], None] | None = None,
    secret: str | None = None,
    **changes: dict[str, Any],
) -> Iterator[DaemonHere]:
    """Serve a simulated rig, four times as fast as a real one, with sections changed."""
    settings = load_settings(find_config("simulated.toml"), data=data)
    wanted: dict[str, dict[str, Any]] = {
        "simulation": {"clock_speed": 4.0},
        "storage": {"reserve_bytes": 0},
    }
    for section, keys in changes.items():
        wanted.setdefault(section, {}).update(keys)
    settings = settings.model_copy(
        update={n: getattr(settings, n).model_copy(update=keys) for n, keys in wanted.items()}
    )
    daemon = Daemon(settings)
    if before is not None:
        before(daemon)
    daemon.start()
    server = make_server(daemon)
    thread = threading.Thread(
        target=server.run, kwargs={"sockets": [listen("127.0.0.1", 0)]}, daemon=True
    )
    thread.start()
    until(lambda: server.url, bool)
    here = DaemonHere(daemon, server.url, secret)
    try:
        here.ready()
        yield here
    finally:
        here.client.close()
        server.should_exit = True
        thread.join(timeout=60)
        daemon.stop()
