"""The LCUS-1 driver: four bytes out, nothing back, and it says so."""

from __future__ import annotations

import os
import time

import pytest

from drivers.errors import ConfigurationError, DeviceLostError, DriverError
from drivers.relay.lcus import LcusSettings, LcusValve
from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings


def read_bytes(master: int, count: int) -> bytes:
    """Return what comes out of a terminal, at least so many bytes where they come in time."""
    deadline, found = time.monotonic() + 5.0, b""
    while len(found) < count and time.monotonic() < deadline:
        try:
            found += os.read(master, 100)
        except BlockingIOError:
            time.sleep(0.01)
    return found


def wait_for(terminal: RelayTerminal, on: bool) -> None:
    """Return when the relay is in a state."""
    deadline = time.monotonic() + 5.0
    while terminal.relay_on != on:
        assert time.monotonic() < deadline, f"the relay never went {'on' if on else 'off'}"
        time.sleep(0.005)


def test_release_moves_the_relay_and_is_never_called_confirmed() -> None:
    """Commanded, unconfirmed; no gauge."""
    terminal = RelayTerminal(World(WorldSettings()), "lcus")
    valve = LcusValve(LcusSettings(terminal.port))
    valve.ensure_ready()
    assert not valve.release().confirmed
    wait_for(terminal, on=True)
    valve.ensure_safe()
    wait_for(terminal, on=False)
    assert valve.vacuum() is None
    assert "unconfirmed" in valve.identity
    valve.close()
    terminal.close()


def test_the_four_bytes_are_those_of_the_board() -> None:
    """A0 01 01 A2 and A0 01 00 A1, this one twice, and a wrong check sum moves nothing."""
    master, slave = os.openpty()
    os.set_blocking(master, False)
    valve = LcusValve(LcusSettings(os.ttyname(slave)))
    valve.ensure_ready()
    valve.release()
    assert read_bytes(master, 12) == bytes.fromhex("a00100a1a00100a1a00101a2")
    valve.close()
    os.close(master)
    os.close(slave)
    terminal = RelayTerminal(World(WorldSettings()), "lcus")
    handle = os.open(terminal.port, os.O_RDWR | os.O_NOCTTY)
    os.write(handle, bytes.fromhex("a00101a3" + "a00101a2"))
    wait_for(terminal, on=True)
    os.close(handle)
    terminal.close()


def test_an_unplugged_board_is_lost() -> None:
    """Even a board that never answers can be missed."""
    terminal = RelayTerminal(World(WorldSettings()), "lcus")
    valve = LcusValve(LcusSettings(terminal.port))
    valve.ensure_ready()
    terminal.unplug()
    with pytest.raises(DeviceLostError):
        valve.release()
    with pytest.raises(DriverError):
        valve.close()


def test_a_terminal_of_no_known_kind_is_refused() -> None:
    """Two boards are simulated."""
    with pytest.raises(ConfigurationError, match="numato"):
        RelayTerminal(World(WorldSettings()), "arduino")
