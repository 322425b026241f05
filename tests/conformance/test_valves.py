"""One suite over every valve: simulated boards always, a real one with --hardware."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from drivers.errors import DriverError
from drivers.relay.lcus import LcusSettings, LcusValve
from drivers.relay.numato import NumatoSettings, NumatoValve
from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings
from drivers.valve import Valve

GAUGE = {"adc_channel": 0, "adc_volts_per_code": 5 / 1024, "held_threshold_v": 2.4}
DRIVERS = {"numato": (NumatoValve, NumatoSettings), "lcus": (LcusValve, LcusSettings)}


def simulated(kind: str, **options: Any) -> Iterator[Valve]:
    """Yield a valve on a simulated board."""
    terminal = RelayTerminal(World(WorldSettings()), kind, **options)
    valve: Valve
    if kind == "numato":
        valve = NumatoValve(NumatoSettings(terminal.port, **GAUGE))  # type: ignore[arg-type]
    else:
        valve = LcusValve(LcusSettings(terminal.port))
    yield valve
    valve.close()
    terminal.close()


@pytest.fixture(
    params=["numato", "numato-crlf", "lcus", pytest.param("real", marks=pytest.mark.hardware)]
)
def valve(request: pytest.FixtureRequest) -> Iterator[Valve]:
    """Yield each valve, made ready."""
    if request.param == "real":
        table = dict(request.getfixturevalue("hardware_config")["valve"])
        driver, settings = DRIVERS[table.pop("driver")]
        made: Iterator[Valve] = iter([driver(settings(**table))])
    elif request.param == "numato-crlf":
        made = simulated("numato", newline=b"\r\n")
    else:
        made = simulated(request.param)
    valve = next(made)
    valve.ensure_ready()
    yield valve
    valve.close()
    next(made, None)


def test_it_is_a_valve(valve: Valve) -> None:
    """It has everything the daemon relies on, and says who it is."""
    assert isinstance(valve, Valve)
    assert valve.identity


def test_it_holds_and_releases_as_often_as_told(valve: Valve) -> None:
    """Every command reports what was commanded, confirmed where the board can."""
    for _ in range(3):
        for command, vacuum_on in ((valve.hold, True), (valve.release, False)):
            report = command()
            assert report.vacuum_on == vacuum_on
            assert report.confirmed == valve.can_confirm
            assert report.garbage == b""


def test_commands_carry_the_time_they_were_sent(valve: Valve) -> None:
    """Times grow."""
    assert valve.hold().sent_monotonic_ns < valve.hold().sent_monotonic_ns


def test_it_reads_its_gauge_or_says_that_it_has_none(valve: Valve) -> None:
    """A reading is in volts; a board without converter returns None."""
    reading = valve.vacuum()
    if reading is not None:
        assert 0 <= reading.code <= 1023
        assert reading.volts >= 0.0


def test_ensure_ready_twice_is_as_good_as_once(valve: Valve) -> None:
    """The second call changes nothing."""
    valve.release()
    valve.ensure_ready()
    valve.hold()


def test_ensure_safe_works_at_any_time_from_any_thread(valve: Valve) -> None:
    """While another thread commands it, before, and after."""
    stop = threading.Event()

    def command() -> None:
        while not stop.is_set():
            try:
                valve.release()
            except DriverError:
                continue

    thread = threading.Thread(target=command)
    thread.start()
    for _ in range(5):
        valve.ensure_safe()
    stop.set()
    thread.join(timeout=10.0)
    assert not thread.is_alive()
    valve.ensure_safe()
    assert valve.hold().vacuum_on


def test_close_twice_is_as_good_as_once_and_it_opens_again(valve: Valve) -> None:
    """A closed valve refuses commands with words, and can be made ready again."""
    valve.close()
    valve.close()
    valve.ensure_safe()
    with pytest.raises(DriverError, match="ensure_ready"):
        valve.release()
    valve.ensure_ready()
    assert valve.hold().vacuum_on
