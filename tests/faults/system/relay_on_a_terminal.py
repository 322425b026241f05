"""A relay board on a pseudo-terminal that outlives every daemon.

``relay_on_a_terminal.py FOLDER``: the port is the link ``FOLDER/port``, and each switching is a
line ``<monotonic seconds> on|off`` of ``FOLDER/log``. SIGUSR1 hangs a sphere.
"""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

from drivers.simulated.relay_terminal import RelayTerminal
from drivers.simulated.world import World, WorldSettings

_LOOK_EVERY_S = 0.001


def main(folder: Path) -> None:
    """Switch until somebody ends it."""
    world = World(WorldSettings())
    board = RelayTerminal(world)
    signal.signal(signal.SIGUSR1, lambda _number, _frame: world.load("acetal", "aluminium", 0.03))
    log = (folder / "log").open("w", buffering=1)
    (folder / "port").symlink_to(board.port)
    was_on = None
    while True:
        if board.relay_on != was_on:
            was_on = board.relay_on
            log.write(f"{time.monotonic():.6f} {'on' if was_on else 'off'}\n")
        time.sleep(_LOOK_EVERY_S)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
