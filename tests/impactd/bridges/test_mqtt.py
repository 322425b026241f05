"""Events over MQTT 5, through Debian's mosquitto."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import jsonschema
import pytest

from impactd.bridges.mqtt import topic_of
from impactd.bridges.place import Place
from impactd.client import RigError
from tests.impactd.api.conftest import Rig

aiomqtt = pytest.importorskip("aiomqtt")
MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin")
SCHEMA = json.loads(
    (Path(__file__).parents[3] / "impactd" / "schemas" / "event.json").read_text("utf-8")
)
pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="needs Debian's mosquitto")


class Broker:
    """A mosquitto on a port of its own, which can go away and come back."""

    def __init__(self, folder: Path) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        self._config = folder / "mosquitto.conf"
        self._config.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self._log = folder / "mosquitto.log"
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    def start(self) -> None:
        """Start it and wait until it listens."""
        with self._log.open("ab") as log:
            self._process = subprocess.Popen(
                [str(MOSQUITTO), "-c", str(self._config)], stdout=log, stderr=log
            )
        for _ in range(200):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port)):
                return
            time.sleep(0.05)
        raise AssertionError(self._log.read_text())

    def stop(self) -> None:
        """End it."""
        if self._process is not None:
            self._process.terminate()
            self._process.wait(timeout=20)


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    """A broker."""
    found = Broker(tmp_path)
    yield found
    found.stop()


@contextlib.contextmanager
def bridge(served: Rig, *words: str) -> Iterator[subprocess.Popen[str]]:
    """`impactd bridge` as a process of its own."""
    environment = {**os.environ, "IMPACTD_URL": served.url, "IMPACTD_TOKEN": served.token("read")}
    process = subprocess.Popen(
        [sys.executable, "-m", "impactd", "bridge", *words],
        env=environment, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        yield process
    finally:
        process.terminate()
        _, said = process.communicate(timeout=30)
        assert "Traceback" not in said, said


async def heard(broker: Broker, topic: str, wanted: int, before: set[bytes] | None = None) -> list:
    """Return the first different messages on a topic, as a stock client hears them.

    Those of ``before`` do not count: each is sent at least once, and may come again.
    """
    found = {}
    async with aiomqtt.Client(
        "127.0.0.1", broker.port, protocol=aiomqtt.ProtocolVersion.V5
    ) as client:
        await client.subscribe(topic, qos=1)
        async for message in client.messages:
            if message.payload not in (before or ()):
                found[message.payload] = message
            if len(found) == wanted:
                return list(found.values())
    return list(found.values())


def collect(broker: Broker, topic: str, wanted: int = 1) -> list:
    """Return messages within a generous limit."""
    return asyncio.run(asyncio.wait_for(heard(broker, topic, wanted), 60))


def publish(served: Rig, numbers: range) -> None:
    """Let events happen."""
    for number in numbers:
        served.daemon.bus.publish("test.counted", {"number": number})


def test_the_light_is_retained_and_a_dead_bridge_is_offline(served: Rig, broker: Broker) -> None:
    """Who subscribes later still gets the light; when the bridge is killed, the broker says so."""
    topic = topic_of("simulated rig")
    with bridge(served, "mqtt", "127.0.0.1", "--port", str(broker.port)) as process:
        assert collect(broker, f"{topic}/online")[0].payload == b"true"
        collect(broker, f"{topic}/status")
        light = collect(broker, f"{topic}/status")[0]  # of a later subscriber
        told = json.loads(light.payload)
        jsonschema.validate(told, SCHEMA)
        assert light.retain
        assert told["sentence"]
        process.kill()
        for _ in range(100):
            if collect(broker, f"{topic}/online")[0].payload == b"false":
                return
            time.sleep(0.1)
        pytest.fail("the broker did not tell that the bridge is dead")


def test_every_event_arrives_over_a_broker_that_restarts(
    served: Rig, broker: Broker, tmp_path: Path
) -> None:
    """Events of the time without broker, and of the time without bridge, arrive afterwards."""
    state = tmp_path / "place.json"
    served.daemon.bus.publish("test.begin", {})
    newest = asyncio.run(served.daemon.bus.last_id())
    Place(state).arrived(newest)
    words = ("mqtt", "127.0.0.1", "--port", str(broker.port), "--topic", "lab/rig")
    words = (*words, "--state", str(state))
    seen: dict[int, int] = {}
    payloads: set[bytes] = set()

    async def story() -> None:
        async def listen(wanted: int) -> None:
            topic = "lab/rig/events/test/counted"
            for message in await heard(broker, topic, wanted, payloads):
                payloads.add(message.payload)
                event = json.loads(message.payload)
                jsonschema.validate(event, SCHEMA)
                assert message.properties.ContentType == "application/json"
                assert ("event-id", str(event["id"])) in message.properties.UserProperty
                seen[event["id"]] = event["data"]["number"]

        first = asyncio.create_task(listen(3))
        await asyncio.sleep(0.5)
        with bridge(served, *words):
            await asyncio.to_thread(publish, served, range(3))
            await asyncio.wait_for(first, 60)
            await asyncio.to_thread(broker.stop)
            await asyncio.to_thread(publish, served, range(3, 6))
            await asyncio.sleep(0.5)
            await asyncio.to_thread(broker.start)
            second = asyncio.create_task(listen(3))
            await asyncio.wait_for(second, 60)
        await asyncio.to_thread(publish, served, range(6, 8))
        third = asyncio.create_task(listen(2))
        await asyncio.sleep(0.5)
        with bridge(served, *words):
            await asyncio.wait_for(third, 60)

    asyncio.run(story())
    assert sorted(seen.values()) == list(range(8))


def test_a_broker_that_is_away_is_told_and_that_it_is_back(served: Rig, broker: Broker) -> None:
    """Each once, on the error output: whoever mistypes a port does not wait in silence."""
    broker.stop()
    with bridge(served, "mqtt", "127.0.0.1", "--port", str(broker.port)) as process:
        assert process.stderr is not None
        away = process.stderr.readline()
        assert away.startswith(f"The MQTT broker 127.0.0.1:{broker.port} cannot be used now: ")
        assert away.endswith("It is tried again until it can.\n")
        time.sleep(3.0)  # tried once more at least
        broker.start()
        assert process.stderr.readline().endswith("is connected.\n")


def test_a_file_that_is_no_place_is_named(tmp_path: Path) -> None:
    """A state file with something else in it is refused, with what to do."""
    (tmp_path / "place.json").write_text("[]")
    with pytest.raises(RigError, match="remove the file"):
        Place(tmp_path / "place.json")


def test_topics_hold_nothing_that_mqtt_reserves() -> None:
    """A rig's name becomes one level of a topic."""
    assert topic_of("rig #1/left +") == "impactd/rig-1-left-"
