"""Webhooks to a real server, checked by the stock library of Standard Webhooks."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from impactd.bridges.place import Place
from impactd.bridges.webhook import Receiver, carry, read_secret
from impactd.client import AsyncRig, RigError
from tests.impactd.api.conftest import Rig

standardwebhooks = pytest.importorskip("standardwebhooks")
SECRET = "whsec_" + base64.b64encode(bytes(range(32))).decode()


class Ear:
    """A server that checks signatures, and refuses as often as it is told to."""

    def __init__(self) -> None:
        self.heard: list[dict] = []
        self.ids: list[str] = []
        self.refuse = 0
        self.enough = threading.Event()
        self.wanted = 0
        ear = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                ear.ids.append(self.headers["webhook-id"])
                if ear.refuse:
                    ear.refuse -= 1
                    self.send_response(503)
                else:
                    verified = standardwebhooks.Webhook(SECRET).verify(body, dict(self.headers))
                    ear.heard.append(verified)
                    self.send_response(204)
                    if len(ear.heard) >= ear.wanted:
                        ear.enough.set()
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}/hook"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture
def ear() -> Iterator[Ear]:
    """A receiver."""
    found = Ear()
    yield found
    found.server.shutdown()
    found.server.server_close()


async def carried(
    served: Rig, ear: Ear, place: Place, wanted: int, kinds: tuple = ("test.",)
) -> None:
    """Carry events until so many arrived."""
    ear.wanted = len(ear.heard) + wanted
    ear.enough.clear()
    receiver = Receiver(ear.url, read_secret(SECRET), kinds)
    pauses: list[float] = []
    said: list[str] = []

    async def pause(seconds: float) -> None:
        pauses.append(seconds)
        await asyncio.sleep(0.02)

    async with AsyncRig(served.url, served.token("read")) as rig:
        work = asyncio.create_task(carry(rig, receiver, place, said.append, sleep=pause))
        assert await asyncio.to_thread(ear.enough.wait, 60)
        await asyncio.sleep(0.2)
        work.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await work
    ear.pauses, ear.said = pauses, said


def test_events_arrive_signed_in_order_and_are_repeated_until_taken(
    served: Rig, ear: Ear, tmp_path: Path
) -> None:
    """Refused five times: the same id comes again, later and later, before the next event."""
    place = Place(tmp_path / "place.json")
    place.arrived(asyncio.run(served.daemon.bus.last_id()))
    for number in range(3):
        served.daemon.bus.publish("test.counted", {"number": number})
    served.daemon.bus.publish("other.kind", {})
    ear.refuse = 5
    asyncio.run(carried(served, ear, place, 3))
    assert [event["data"]["number"] for event in ear.heard] == [0, 1, 2]
    assert ear.ids[:6] == [f"event-{ear.heard[0]['id']}"] * 6
    assert ear.pauses == [1, 2, 4, 8, 16]
    away, back = ear.said  # each once
    assert f"cannot be used now: it answered {ear.ids[0]} with " in away
    assert back == f"The receiver {ear.url} is connected."
    served.daemon.bus.publish("test.counted", {"number": 3})
    asyncio.run(carried(served, ear, Place(tmp_path / "place.json"), 1))
    assert [event["data"]["number"] for event in ear.heard] == [0, 1, 2, 3]
    assert json.loads((tmp_path / "place.json").read_text())["last_event"] == ear.heard[-1]["id"]


def test_a_weak_secret_is_refused() -> None:
    """What is no base64, or too short, is named with how to make a good one."""
    with pytest.raises(RigError, match="base64"):
        read_secret("whsec_ä")
    with pytest.raises(RigError, match="openssl rand"):
        read_secret("whsec_c2hvcnQ=")
