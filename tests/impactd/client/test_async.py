"""The same from an event loop, and events that survive a lost line."""

from __future__ import annotations

import threading
from collections.abc import Callable

import anyio
import pytest

from impactd.client import AsyncRig, Rig, mm
from tests.impactd.api.conftest import Rig as Served
from tests.impactd.client.line import Line


def test_a_series_is_awaited_beside_its_events(make_async: Callable[[], AsyncRig]) -> None:
    """While drops are made, the events of each are heard in the same loop; a record is read."""
    pytest.importorskip("xarray")

    async def story() -> None:
        heard = []
        async with make_async() as rig:
            await rig.wait_until_ready()
            listening = anyio.Event()

            async def listen() -> None:
                newest = rig.events()
                listening.set()
                async for event in newest:
                    heard.append(event)
                    if [one.kind for one in heard].count("drop.analysed") == 2:
                        return

            async with anyio.create_task_group() as group:
                group.start_soon(listen)
                await listening.wait()
                await anyio.sleep(0.5)
                series = rig.series("acetal", "aluminium", 30 * mm, repeats=2)
                shots = [shot async for shot in series]
            record = await rig.record(shots[0], 0.0, 1e-3)
            found = [shot.number async for shot in rig.shots(limit=2)]
        assert found == [shots[1].number, shots[0].number]
        assert record.signal.attrs["units"] == "V"
        assert [one.id for one in heard] == sorted({one.id for one in heard})
        stored = [one.data["shot"] for one in heard if one.kind == "drop.stored"]
        assert stored == [shot.number for shot in shots]

    anyio.run(story)


def test_a_cancelled_wait_aborts_the_drop(
    served: Served, rig: Rig, make_async: Callable[[], AsyncRig]
) -> None:
    """Who gives up waiting for a drop leaves none behind."""
    rig.wait_until_ready()

    async def story() -> None:
        async with make_async() as own:
            with anyio.move_on_after(0.3) as scope:
                await own.drop("acetal", "aluminium", 30 * mm)
            assert scope.cancelled_caught

    anyio.run(story)
    newest = served.reader.get("/v1/drops", params={"limit": 1}).json()["items"][0]
    assert served.ended(newest["number"])["state"] == "aborted"
    rig.wait_until_ready()


@pytest.mark.parametrize("asynchronous", [False, True], ids=["sync", "async"])
def test_events_go_on_where_the_line_broke(served: Served, rig: Rig, asynchronous: bool) -> None:
    """Cut in the middle, and again before anything was heard: none is lost, none comes twice."""
    rig.wait_until_ready()
    publish = served.daemon.bus.publish
    with Line(served.url) as line:
        listener = _heard_async if asynchronous else _heard
        numbers = listener(line, served.token("read"), publish)
    assert numbers == list(range(6))
    assert line.connections >= 3


_KIND = "test.counted"


def _steps(line: Line, publish: Callable) -> Callable[[int], None]:
    def after(count: int) -> None:
        """Do what comes after so many events: cut, and publish while nobody listens."""
        if count == 0:
            line.cut()
            publish(_KIND, {"number": 0})
            publish(_KIND, {"number": 1})
        elif count == 2:
            line.cut()
            for number in (2, 3, 4, 5):
                publish(_KIND, {"number": number})

    return after


def _heard(line: Line, token: str, publish: Callable) -> list[int]:
    numbers: list[int] = []
    after = _steps(line, publish)
    with Rig(line.url, token) as rig:
        timer = threading.Timer(1.0, after, [0])
        timer.start()
        for event in rig.events():
            if event.kind != _KIND:
                continue
            numbers.append(event.data["number"])
            after(len(numbers))
            if len(numbers) == 6:
                break
        timer.join()
    return numbers


def _heard_async(line: Line, token: str, publish: Callable) -> list[int]:
    numbers: list[int] = []
    after = _steps(line, publish)

    async def story() -> None:
        async with AsyncRig(line.url, token) as rig, anyio.create_task_group() as group:

            async def begin() -> None:
                await anyio.sleep(1.0)
                await anyio.to_thread.run_sync(after, 0)

            group.start_soon(begin)
            async for event in rig.events():
                if event.kind != _KIND:
                    continue
                numbers.append(event.data["number"])
                await anyio.to_thread.run_sync(after, len(numbers))
                if len(numbers) == 6:
                    break

    anyio.run(story)
    return numbers
