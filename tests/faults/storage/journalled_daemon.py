"""`impactd`, with a journal of every sphere that falls: the rig's own witness, beside the archive.

Run as a script; the journal is the file named by ``FALLS_JOURNAL``. It is appended to with one
write per fall, so that a killed process leaves every line it got to.
"""

from __future__ import annotations

import os

from drivers.simulated.world import World

_let_go = World._let_go


def _let_go_and_note(world: World) -> None:
    before = world._releases
    _let_go(world)
    if world._releases != before:
        file = os.open(os.environ["FALLS_JOURNAL"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        os.write(file, f"{os.getpid()}\n".encode())
        os.close(file)


if __name__ == "__main__":
    World._let_go = _let_go_and_note  # type: ignore[method-assign]
    from impactd.cli import main

    main()
