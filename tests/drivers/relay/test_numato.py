"""The Numato driver over a real pseudo-terminal, healthy and broken."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    ProtocolError,
)
from drivers.relay.numato import NumatoSettings, NumatoValve
from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings


@dataclass
class Bench:
    """A valve and the board it talks to."""

    world: World
    terminal: RelayTerminal
    valve: NumatoValve


def settings(port: str, **changes: object) -> NumatoSettings:
    """Return settings with a calibrated gauge."""
    gauge = {"adc_channel": 0, "adc_volts_per_code": 5 / 1024, "held_threshold_v": 2.4}
    return NumatoSettings(port, **(gauge | changes))  # type: ignore[arg-type]


@pytest.fixture
def bench() -> Iterator[Bench]:
    """Yield a valve on a simulated board, made ready."""
    world = World(WorldSettings())
    terminal = RelayTerminal(world)
    valve = NumatoValve(settings(terminal.port, timeout_s=0.2))
    valve.ensure_ready()
    yield Bench(world, terminal, valve)
    world.faults.clear()
    with contextlib.suppress(DeviceLostError, DeviceNotFoundError):  # a test may have cut it
        valve.close()
    terminal.close()


def wait_until_off(terminal: RelayTerminal) -> None:
    """Return when the relay has fallen back."""
    deadline = time.monotonic() + 5.0
    while terminal.relay_on:
        assert time.monotonic() < deadline, "the relay stayed on"
        time.sleep(0.005)


def test_identity_is_in_the_boards_own_words(bench: Bench) -> None:
    """Version and id as the board states them."""
    assert bench.valve.identity == "Numato relay board, version 00000008, id 00000000"


def test_release_lets_the_sphere_go_and_the_gauge_shows_it(bench: Bench) -> None:
    """Held, released, open tube: three readings."""
    bench.world.load("acetal", "polycarbonate", 0.03)
    held = bench.valve.vacuum()
    assert held is not None
    assert held.held
    assert held.volts == pytest.approx(bench.world.settings.vacuum_held_v, abs=0.01)
    bench.valve.release()
    assert bench.terminal.relay_on
    gone = bench.valve.vacuum()
    assert gone is not None
    assert not gone.held


def test_a_half_typed_command_is_cleared_by_a_bare_return() -> None:
    """What the last user left behind is not glued to the first command."""
    world = World(WorldSettings())
    terminal = RelayTerminal(world)
    handle = os.open(terminal.port, os.O_RDWR | os.O_NOCTTY)
    os.write(handle, b"relay o")
    time.sleep(0.05)
    os.close(handle)
    valve = NumatoValve(settings(terminal.port))
    valve.ensure_ready()
    assert valve.hold().garbage == b""
    valve.close()
    terminal.close()


def test_garbage_is_tolerated_and_reported(bench: Bench) -> None:
    """Even with prompts in it."""
    bench.world.faults.serial_garbage = b"\x00\xff>>zzz\r\n"
    report = bench.valve.release()
    assert report.confirmed
    assert b"zzz" in report.garbage
    assert bench.valve.vacuum() is not None


def test_a_stuck_relay_is_an_error_that_says_what_to_do(bench: Bench) -> None:
    """The read-back contradicts the command."""
    bench.world.faults.relay_stuck = True
    with pytest.raises(ProtocolError, match=r"told 'on' and reads back 'off'.*by hand") as caught:
        bench.valve.release()
    assert caught.value.remedy


def test_silence_is_a_timeout_and_the_safe_word_goes_out(bench: Bench) -> None:
    """A board that does not answer may still listen."""
    bench.world.faults.serial_silent = True
    with pytest.raises(DeviceTimeoutError, match=r"did not answer 'relay on 0' within 0.2 s"):
        bench.valve.release()
    wait_until_off(bench.terminal)
    bench.world.faults.serial_silent = False
    assert bench.valve.hold().confirmed


def test_a_cut_cable_is_a_lost_device_and_stays_an_error(bench: Bench) -> None:
    """Nobody is told that a valve is safe which cannot be reached."""
    bench.world.faults.serial_cut = True
    time.sleep(0.2)
    with pytest.raises(DeviceLostError, match="gone"):
        bench.valve.vacuum()
    with pytest.raises(DeviceNotFoundError):
        bench.valve.ensure_safe()


def test_a_port_in_use_is_refused(bench: Bench) -> None:
    """Exclusive means exclusive."""
    with pytest.raises(DeviceBusyError, match="in use"):
        NumatoValve(settings(bench.terminal.port)).ensure_ready()


def test_a_port_that_is_not_there_is_named() -> None:
    """With a hint where to look."""
    with pytest.raises(DeviceNotFoundError, match=r"/dev/no-such-port.*by-id"):
        NumatoValve(NumatoSettings("/dev/no-such-port")).ensure_ready()


def test_another_kind_of_board_is_refused() -> None:
    """Words that are no reply are never taken for one."""
    master, slave = os.openpty()
    tty.setraw(slave)

    def chatter() -> None:
        while data := os.read(master, 100):
            if data.endswith(b"end"):  # may come glued to the last words
                return
            os.write(master, data + b"\r\nERROR 7, what?\r\n>")

    thread = threading.Thread(target=chatter, daemon=True)
    thread.start()
    with pytest.raises(ProtocolError, match="ERROR 7"):
        NumatoValve(NumatoSettings(os.ttyname(slave))).ensure_ready()
    os.write(slave, b"end")
    thread.join(timeout=5.0)
    os.close(master)
    os.close(slave)


def test_a_gauge_without_calibration_is_refused() -> None:
    """The board's reference voltage is nobody's guess."""
    with pytest.raises(ConfigurationError, match="reference voltage"):
        NumatoSettings("/dev/x", adc_channel=0)


def test_without_a_gauge_there_is_no_reading() -> None:
    """None, not a made-up number."""
    assert NumatoValve(NumatoSettings("/dev/x")).vacuum() is None


def test_a_gauge_that_falls_when_a_sphere_is_held_is_read_the_other_way(bench: Bench) -> None:
    """held_above = false turns the comparison round."""
    bench.valve.close()
    other = NumatoValve(settings(bench.terminal.port, held_above=False))
    other.ensure_ready()
    reading = other.vacuum()
    assert reading is not None
    assert reading.held  # the open tube reads low
    other.close()


def test_ensure_safe_cuts_a_slow_conversation_short(bench: Bench) -> None:
    """The waiting command ends with AbortedError long before its own timeout."""
    patient = NumatoValve(settings(bench.terminal.port, timeout_s=30.0))
    bench.valve.close()
    patient.ensure_ready()
    bench.world.faults.serial_silent = True
    caught: list[BaseException] = []

    def release() -> None:
        try:
            patient.release()
        except AbortedError as error:
            caught.append(error)

    thread = threading.Thread(target=release)
    thread.start()
    time.sleep(0.1)
    bench.world.faults.serial_silent = False
    patient.ensure_safe()
    thread.join(timeout=10.0)
    assert len(caught) == 1
    wait_until_off(bench.terminal)
    patient.close()


def test_a_program_that_ends_without_closing_leaves_the_vacuum_on() -> None:
    """The safe word goes out at exit."""
    world = World(WorldSettings())
    terminal = RelayTerminal(world)
    script = (
        "import sys\n"
        "from drivers.relay.numato import NumatoSettings, NumatoValve\n"
        f"valve = NumatoValve(NumatoSettings({terminal.port!r}))\n"
        "valve.ensure_ready(); valve.release(); sys.exit(3)\n"
    )
    done = subprocess.run([sys.executable, "-c", script], check=False, timeout=60)
    assert done.returncode == 3
    wait_until_off(terminal)
    terminal.close()


def test_a_board_plugged_in_again_is_made_safe() -> None:
    """After a loss, ensure_safe opens the port again and switches the vacuum on."""
    world = World(WorldSettings())
    first = RelayTerminal(world)
    link = f"/tmp/relay-{os.getpid()}"  # a lasting name, as udev gives
    os.symlink(first.port, link)
    try:
        valve = NumatoValve(settings(link))
        valve.ensure_ready()
        first.unplug()
        with pytest.raises(DeviceLostError):
            valve.release()
        second = RelayTerminal(world)
        os.unlink(link)
        os.symlink(second.port, link)
        valve.ensure_safe()
        assert valve.release().confirmed
        valve.close()
        second.close()
    finally:
        os.unlink(link)
