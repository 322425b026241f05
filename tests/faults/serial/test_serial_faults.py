"""Whatever a relay board says or leaves unsaid: nobody believes of the valve what is not so."""

from __future__ import annotations

import contextlib
import os
import termios
import threading
import time

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from drivers.errors import DeviceNotFoundError, DisobeyedError, DriverError
from drivers.relay.lcus import LcusSettings, LcusValve
from drivers.relay.numato import NumatoSettings, NumatoValve
from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings

from .hostile_board import MISHAPS, HostileBoard, Mishap

TIMEOUT_S = 0.04
# The promise is 500 ms; machines that run tests are noisy, so the figure is printed.
SAFE_LIMIT_S = 5.0
CALLS = ("hold", "release", "ensure_safe", "vacuum", "ensure_ready")

scripts = st.lists(
    st.builds(
        Mishap,
        kind=st.sampled_from(("well", "well", "well", *MISHAPS)),
        noise=st.binary(max_size=24) | st.sampled_from([b">", b"on", b"\n\roff\n\r>", b"ver\r\n>"]),
        at=st.integers(0, 400),
    ),
    max_size=14,
)
calls = st.lists(st.sampled_from(CALLS), min_size=1, max_size=6)

figures = {"scripts": 0, "reports": 0, "errors": 0, "slowest_safe_s": 0.0}


def _check_safe(board: HostileBoard, began_s: float) -> None:
    """Wait until the relay has fallen back, and note how long that took."""
    ends_s = time.monotonic() + SAFE_LIMIT_S
    while board.relay_on:
        assert time.monotonic() < ends_s, "the valve stayed open"
        time.sleep(0.001)
    took_s = max(0.0, board.turned_off_s - began_s)
    figures["slowest_safe_s"] = max(figures["slowest_safe_s"], took_s)


def _call(valve: NumatoValve, board: HostileBoard, name: str) -> None:
    """Make one call; whatever it returns must be true of the relay, not of the conversation."""
    began_s = time.monotonic()
    board.refused_off = False
    try:
        report = getattr(valve, name)()
    except DriverError:
        figures["errors"] += 1
        obeys = not (board.unplugged or board.refused_off)
        if name in ("release", "hold", "ensure_safe") and obeys and valve._port.is_open:
            time.sleep(0.002)
            if not board.refused_off:
                _check_safe(board, began_s)
        return
    figures["reports"] += 1
    if name in ("hold", "release"):
        assert report.confirmed
        assert board.relay_on == (name == "release"), f"{name} was believed and is not so"
    elif name == "ensure_safe" and valve._port.is_open:
        assert not board.relay_on, "safe was believed and is not so"
    elif name == "vacuum" and report is not None:
        assert 0 <= report.code <= 1023


def _run(script: list[Mishap], names: list[str]) -> None:
    board = HostileBoard(script)
    valve = NumatoValve(
        NumatoSettings(
            board.port,
            adc_channel=0,
            adc_volts_per_code=5 / 1024,
            held_threshold_v=2.4,
            timeout_s=TIMEOUT_S,
        )
    )
    try:
        with contextlib.suppress(DriverError):
            valve.ensure_ready()
            assert not board.relay_on
        for name in names:
            _call(valve, board, name)
        board.heal()
        if not board.unplugged and valve._port.is_open:
            began_s = time.monotonic()
            for _ in range(3):  # a busy host may miss a time-out of 40 ms
                with contextlib.suppress(DriverError):
                    valve.ensure_safe()
                    break
            _check_safe(board, began_s)
    finally:
        figures["scripts"] += 1
        with contextlib.suppress(DriverError):
            valve.close()
        board.close()


def _tell() -> None:
    print(
        f"{figures['scripts']} scripts, {figures['reports']} answers believed, "
        f"{figures['errors']} refused, 0 wrong; slowest safe state "
        f"{figures['slowest_safe_s'] * 1e3:.0f} ms"
    )


_quiet = {
    "deadline": None,
    "database": None,
    "derandomize": True,
    "suppress_health_check": list(HealthCheck),
}


@settings(max_examples=100, **_quiet)
@given(script=scripts, names=calls)
def test_no_script_makes_a_wrong_belief(script: list[Mishap], names: list[str]) -> None:
    """Garbage, lost echoes, cut, late, doubled and flipped answers, a stuck, deaf or cut board."""
    _run(script, names)


@pytest.mark.slow
@pytest.mark.timeout(0)
@pytest.mark.parametrize("count", [2000, pytest.param(10_000, marks=pytest.mark.soak)])
def test_thousands_of_scripts_make_no_wrong_belief(count: int) -> None:
    """The same, many times."""
    figures.update(scripts=0, reports=0, errors=0, slowest_safe_s=0.0)
    try:
        settings(max_examples=count, **_quiet)(given(script=scripts, names=calls)(_run))()
    finally:
        _tell()


def test_a_late_answer_never_answers_the_next_question() -> None:
    """An "on" that comes after its time-out does not confirm a release that was not obeyed."""
    healthy = [Mishap() for _ in range(6)]  # CR, ver, id get, relay off, relay read; relay on
    board = HostileBoard([*healthy, Mishap("late"), Mishap("mute"), Mishap("mute")])
    valve = NumatoValve(NumatoSettings(board.port, timeout_s=0.2))
    try:
        valve.ensure_ready()
        with pytest.raises(DriverError):
            valve.release()  # its "on" is under way
        _check_safe(board, time.monotonic())
        board._script[:] = [Mishap("stuck")]
        with pytest.raises(DisobeyedError):
            valve.release()
        assert not board.relay_on
    finally:
        board.heal()
        valve.close()
        board.close()


@pytest.mark.parametrize("noise", [b"x", b"relay off 0 ", b"\x00\xff"])
def test_a_board_that_babbles_without_end_is_left_in_time(noise: bytes) -> None:
    """A flood of bytes neither fills the memory nor keeps the caller for ever."""
    board = HostileBoard([])
    valve = NumatoValve(NumatoSettings(board.port, timeout_s=0.3))
    valve.ensure_ready()
    board._line = lambda line, mishap: None  # type: ignore[method-assign]
    ending = threading.Event()

    def babble() -> None:
        os.set_blocking(board._master, False)
        while not ending.is_set():
            with contextlib.suppress(BlockingIOError):
                os.write(board._master, noise * 100)
            time.sleep(0)

    thread = threading.Thread(target=babble)
    thread.start()
    try:
        with pytest.raises(DriverError):
            valve.release()
        with pytest.raises(DriverError):
            valve.ensure_safe()
    finally:
        ending.set()
        thread.join()
        with contextlib.suppress(DriverError):
            valve.close()
        board.close()


def test_a_board_unplugged_while_it_is_opened_is_not_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The port's own kind of error is translated like the others."""

    def gone(*_arguments: object) -> None:
        raise termios.error(5, "Input/output error")

    board = HostileBoard([])
    monkeypatch.setattr(termios, "tcflush", gone)
    try:
        with pytest.raises(DeviceNotFoundError):
            NumatoValve(NumatoSettings(board.port)).ensure_ready()
    finally:
        board.close()


half_frames = st.binary(max_size=6) | st.sampled_from([b"\xa0", b"\xa0\x01", b"\xa0\x01\x01"])


def _run_lcus(before: bytes, names: list[str]) -> None:
    world = World(WorldSettings())
    terminal = RelayTerminal(world, "lcus")
    handle = os.open(terminal.port, os.O_RDWR | os.O_NOCTTY)
    os.write(handle, before)
    valve = LcusValve(LcusSettings(terminal.port, timeout_s=5.0))
    try:
        valve.ensure_ready()
        for name in names:
            report = getattr(valve, name)()
            assert report is None or not report.confirmed
        began_s = time.monotonic()
        valve.ensure_safe()
        while terminal.relay_on:
            assert time.monotonic() - began_s < SAFE_LIMIT_S
            time.sleep(0.001)
    finally:
        valve.close()
        terminal.close()
        os.close(handle)


@settings(max_examples=50, **_quiet)
@given(before=half_frames, names=st.lists(st.sampled_from(CALLS[:3]), max_size=5))
def test_a_board_that_never_answers_is_never_believed_and_made_safe(
    before: bytes, names: list[str]
) -> None:
    """Half a frame left behind by somebody does not swallow "vacuum on"."""
    _run_lcus(before, names)
