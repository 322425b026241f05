"""`impactd make-safe` closes the valve that a killed daemon left open."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings

from .supervisor import Supervisor

RELAY_ON = {"numato": b"relay on 0\r", "lcus": b"\xa0\x01\x01\xa2"}


def make_safe(config: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Run the command as the unit does after the daemon's end."""
    return subprocess.run(
        [sys.executable, "-m", "impactd", "make-safe", "--config", str(config), *options],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )


def settings(folder: Path, board: RelayTerminal, kind: str = "numato") -> Path:
    """Write settings of a real rig on that board; all else in them is wrong."""
    file = folder / "impactd.toml"
    file.write_text(
        f'[valve]\ndriver = "{kind}"\nport = "{board.port}"\n[trigger]\nlevle_v = "much"\n'
    )
    return file


@pytest.fixture(params=["numato", "lcus"])
def board(request: pytest.FixtureRequest) -> Iterator[RelayTerminal]:
    """Give a board whose relay has pulled: the valve is open."""
    terminal = RelayTerminal(World(WorldSettings()), request.param)
    with serial.Serial(terminal.port) as port:
        port.write(RELAY_ON[request.param])
        while not terminal.relay_on:
            threading.Event().wait(0.01)
    yield terminal
    terminal.close()


def test_the_valve_of_a_killed_daemon_is_closed(tmp_path: Path) -> None:
    """SIGKILL with the sphere released leaves the valve open; the command closes it."""
    supervisor = Supervisor(tmp_path, watchdog_s=60.0, abort_s=0.2, pause_s=0.1)
    try:
        supervisor.open_valve()
        supervisor.process.kill()
        supervisor.process.wait()
        assert supervisor.board.relay_on
        result = make_safe(settings(tmp_path, supervisor.board))
        assert not supervisor.board.relay_on
        assert (result.returncode, result.stderr) == (0, "")
        assert "confirmed" in result.stdout
    finally:
        supervisor.end()


def test_each_board_is_told_and_says_how_sure_it_is(
    tmp_path: Path, board: RelayTerminal, request: pytest.FixtureRequest
) -> None:
    """A board with read-back confirms, the other is commanded; a mistake elsewhere is no matter."""
    kind = request.node.callspec.params["board"]
    result = make_safe(settings(tmp_path, board, kind))
    assert not board.relay_on
    assert (result.returncode, result.stderr) == (0, "")
    assert {"numato": "(confirmed)", "lcus": "cannot confirm"}[kind] in result.stdout


@pytest.mark.parametrize("board", ["numato"], indirect=True)
def test_it_waits_for_the_daemon_to_let_go(tmp_path: Path, board: RelayTerminal) -> None:
    """A port that is held for another second is taken as soon as it is free."""
    holder = serial.Serial(board.port, exclusive=True)
    timer = threading.Timer(1.5, holder.close)
    timer.start()
    result = make_safe(settings(tmp_path, board))
    timer.join()
    assert result.returncode == 0, result.stderr
    assert not board.relay_on


@pytest.mark.parametrize("board", ["numato"], indirect=True)
def test_a_relay_that_stays_on_is_told_in_one_sentence(
    tmp_path: Path, board: RelayTerminal
) -> None:
    """A stuck relay ends with exit code 1 and with what to do by hand."""
    board._world.faults.relay_stuck = True
    result = make_safe(settings(tmp_path, board), "--wait", "0.5")
    assert result.returncode == 1
    assert result.stderr.count("\n") == 1
    assert "could NOT be made safe" in result.stderr
    assert "by hand" in result.stderr


@pytest.mark.parametrize("board", ["numato"], indirect=True)
def test_it_gives_up_on_a_port_that_stays_busy(tmp_path: Path, board: RelayTerminal) -> None:
    """Beside a daemon that lives the command changes nothing, and says that the port is in use."""
    with serial.Serial(board.port, exclusive=True):
        result = make_safe(settings(tmp_path, board), "--wait", "0.5")
    assert result.returncode == 1
    assert "is in use" in result.stderr
    assert board.relay_on


def test_the_simulated_rig_has_nothing_to_make_safe() -> None:
    """Its board is a thread of the daemon and ends with it."""
    result = make_safe(Path(__file__).parents[3] / "config" / "simulated.toml")
    assert result.returncode == 0
    assert "nothing to make safe" in result.stdout


def test_it_loads_nothing_heavy() -> None:
    """The valve does not wait for numpy, the web framework or the database."""
    code = (
        "import sys, impactd.cli, impactd.console.make_safe, drivers.relay.numato\n"
        "heavy = {'numpy', 'numba', 'scipy', 'h5py', 'fastapi', 'httpx2', 'sqlite3', 'usb'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
