"""Events: written first, told in order, none lost, none twice."""

from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path

import pytest

from impactd.events import EventBus
from impactd.storage.archive import Archive


@pytest.fixture
def bus(tmp_path: Path):
    """A bus over a real table."""
    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        yield EventBus(archive.events)


def test_a_listener_that_returns_misses_nothing(bus):
    """Events between two connections are told on the second one."""
    for value in range(5):
        bus.publish("test", {"value": value})

    async def listen() -> list[int]:
        seen = []
        async for event in bus.listen(2):
            seen.append(event.data["value"])
            if len(seen) == 3:
                break
        return seen

    assert asyncio.run(listen()) == [2, 3, 4]


def test_many_threads_publish_and_every_event_is_told_once_in_order(bus):
    """Threads and a listener at the same time: no event is lost or doubled."""
    count = 4 * 25

    def publish() -> None:
        for value in range(25):
            bus.publish("test", {"value": value})

    async def listen() -> list[int]:
        threads = [threading.Thread(target=publish) for _ in range(4)]
        seen = []
        stream = bus.listen(0)
        for thread in threads:
            thread.start()
        async for event in stream:
            seen.append(event.id)
            if len(seen) == count:
                break
        await stream.aclose()
        for thread in threads:
            thread.join()
        return seen

    assert asyncio.run(asyncio.wait_for(listen(), 30)) == list(range(1, count + 1))


def test_closing_ends_every_listener(bus):
    """A server that shuts down is not kept by a stream."""

    async def listen() -> int:
        told = 0
        async for _ in bus.listen(None):
            told += 1
        return told

    async def both() -> int:
        task = asyncio.create_task(listen())
        await asyncio.sleep(0.05)
        bus.close()
        return await asyncio.wait_for(task, 10)

    assert asyncio.run(both()) == 0


def test_a_drop_can_be_followed_as_server_sent_events(rig, shot):
    """A stream from the beginning tells the drop's way to `analysed`, with ids to return to."""
    ids, kinds = [], []
    with rig.reader.stream("GET", "/v1/events", headers={"Last-Event-ID": "0"}) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            name, _, value = line.partition(": ")
            if name == "id":
                ids.append(int(value))
            elif name == "event":
                kinds.append(value)
                if value == "drop.analysed":
                    break
    assert ids == sorted(set(ids))
    assert "drop.requested" in kinds


def test_a_reader_that_leaves_in_the_middle_is_no_failure(rig, capfd):
    """Closing a stream with a backlog neither logs an error nor stops the next request."""
    for value in range(300):
        rig.daemon.bus.publish("test", {"value": value})
    with rig.reader.stream("GET", "/v1/events", headers={"Last-Event-ID": "0"}) as answer:
        next(answer.iter_lines())
    assert rig.reader.get("/v1/drops").status_code == 200
    assert "request failed" not in capfd.readouterr().out


def test_a_stream_ends_with_its_token(rig):
    """A token that is taken back ends what was opened with it, at the next thing that is told."""
    secret = rig.token("read", "leaver")
    number = rig.daemon.archive.tokens.check(secret).id
    headers = {"Authorization": f"Bearer {secret}", "Last-Event-ID": "0"}
    with rig.anybody.stream("GET", "/v1/events", headers=headers) as answer:
        assert answer.status_code == 200
        lines = answer.iter_lines()
        next(lines)
        rig.daemon.archive.tokens.revoke(number)
        stop = threading.Event()

        def tell() -> None:
            while not stop.wait(0.1):
                rig.daemon.bus.publish("test", {})

        teller = threading.Thread(target=tell)
        teller.start()
        try:
            began_s = time.monotonic()
            for _ in lines:
                assert time.monotonic() - began_s < 30, "the stream goes on without a token"
        finally:
            stop.set()
            teller.join()
    assert rig.anybody.get("/v1/events", headers=headers).status_code == 401


def test_a_last_event_id_that_is_none_is_refused(rig):
    """A wrong id is a problem, not a silent restart."""
    answer = rig.reader.get("/v1/events", headers={"Last-Event-ID": "x"})
    assert answer.status_code == 422
