"""Cases with an open valve: the relay board stands outside the daemon and outlives it.

The unit is the shipped one but for ExecStart=, which puts the simulated rig on that board;
ExecStopPost= is as shipped and finds the board by the settings.
"""

from __future__ import annotations

import shutil
import sqlite3
import time
from pathlib import Path

from unit import DATA, Unit, run, until

CHECKOUT = Path(__file__).parents[3]
FOLDER = Path("/run/relay-board")
DROP_IN = f"""
[Service]
Environment=RELAY_PORT={FOLDER}/port
ExecStart=
ExecStart=/opt/impactd/bin/python {CHECKOUT}/tests/faults/state/daemon_on_a_port.py serve \
--config /etc/impactd/simulated.toml --data {DATA}
"""
# The sphere falls in the board's world and not in the daemon's, so the valve stays open for the
# fall's time and this margin, long enough to do something to the daemon.
MARGIN_S = 6.0
HELD_BEYOND_S = 6.0
# How much later than without a lock the valve may close: the daemon's own threads on a busy host.
LATE_S = 1.0


class Board:
    """The relay board's service."""

    def __enter__(self) -> Board:
        """Start it anew."""
        run("systemctl", "reset-failed")
        run(
            *("systemd-run", "--unit=relay-board", "--property=User=impactd"),
            "--property=RuntimeDirectory=relay-board",
            "--setenv=PYTHONDONTWRITEBYTECODE=1",
            "/opt/impactd/bin/python",
            str(Path(__file__).with_name("relay_on_a_terminal.py")),
            str(FOLDER),
        )
        until((FOLDER / "port").exists, "there is no relay board")
        return self

    def __exit__(self, *_error: object) -> None:
        """End it."""
        run("systemctl", "stop", "relay-board")
        shutil.rmtree(FOLDER, ignore_errors=True)

    def switched(self) -> list[tuple[float, bool]]:
        """Return each switching: when, on the monotonic clock [s], and whether the relay pulled."""
        lines = (FOLDER / "log").read_text().splitlines()
        return [(float(when), what == "on") for when, what in map(str.split, lines)]

    def wait_for(self, *, on: bool) -> float:
        """Wait until the relay is there; return since when it is. [s]"""
        return float(
            until(lambda: (s := self.switched()[-1])[1] == on and s[0], f"never {on=}", 0.005)
        )


def _open_valve(unit: Unit, board: Board) -> tuple[int, float]:
    """Start a drop; return its number, and when its valve opened. [s]"""
    unit.wait_ready()
    run("systemctl", "kill", "--signal=USR1", "relay-board")
    time.sleep(0.2)  # a sphere hangs
    number = unit.drop()
    return number, board.wait_for(on=True)


def _start(unit: Unit) -> None:
    unit.configure(board_port=f"{FOLDER}/port", timeouts__impact_margin_s=str(MARGIN_S))
    unit.drop_in(DROP_IN)
    unit.start()


def locked_index(unit: Unit) -> str:
    """A write lock on the index between opening and closing keeps the valve open no longer."""
    with Board() as board:
        _start(unit)
        number, opened_s = _open_valve(unit, board)
        free_s = board.wait_for(on=False) - opened_s
        unit.ended(number)
        pid = unit.show("MainPID")
        _number, opened_s = _open_valve(unit, board)
        with sqlite3.connect(DATA / "index.sqlite", isolation_level=None) as index:
            index.execute("BEGIN IMMEDIATE")
            time.sleep(free_s + HELD_BEYOND_S)
            still_open, same = board.switched()[-1][1], unit.show("MainPID") == pid
            index.execute("ROLLBACK")
        locked_s = board.wait_for(on=False) - opened_s
    assert not still_open, f"open for {locked_s:.1f} s under a lock, {free_s:.1f} s without"
    assert locked_s < free_s + LATE_S, f"{locked_s:.2f} s under a lock, {free_s:.2f} s without"
    assert same, "the daemon was replaced meanwhile"
    return f"open for {locked_s:.2f} s under a lock, for {free_s:.2f} s without"


def frozen_daemon(unit: Unit) -> str:
    """Stopped dead with an open valve: the valve is closed before another daemon starts."""
    return _without_last_words(unit, "STOP")


def killed_daemon(unit: Unit) -> str:
    """Killed with an open valve: the valve is closed before another daemon starts."""
    return _without_last_words(unit, "KILL")


def _without_last_words(unit: Unit, name: str) -> str:
    with Board() as board:
        _start(unit)
        number, _opened_s = _open_valve(unit, board)
        pid = unit.show("MainPID")
        gone_s = unit.signal(name)
        closed_s = board.wait_for(on=False)
        until(lambda: unit.show("MainPID") not in ("0", pid), "no other daemon was started")
        unit.wait_ready()
        ready_s = time.monotonic()
        assert closed_s < unit.began_s(), "the next daemon closed the valve, not ExecStopPost="
        drop = unit.get(f"/v1/drops/{number}")
    assert drop["state"] == "interrupted", drop
    return (
        f"valve closed by ExecStopPost= {closed_s - gone_s:.1f} s after SIG{name}, "
        f"ready again after {ready_s - gone_s:.1f} s"
    )
