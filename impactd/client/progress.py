"""How far a long wait is: a bar on a terminal or in a notebook, nothing in a pipe."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class ProgressBar:
    """A bar that is there while there is something to wait for.

    Notes
    -----
    On standard error, so that it never gets into what a program prints; `rich` honours
    ``NO_COLOR`` and ``TERM``, and draws a widget in Jupyter.
    """

    def __init__(self) -> None:
        self._shown: tuple[Progress, TaskID] | None = None

    def show(self, text: str, share: float | None = None) -> None:
        """Show what is being done; with a share (0..1) also how much and how long it will take."""
        if not (sys.stderr.isatty() or "ipykernel" in sys.modules):
            return
        if self._shown is None:
            self._shown = _begin(text)
        bar, task = self._shown
        bar.update(task, description=text, total=None if share is None else 1.0)
        if share is not None:
            bar.update(task, completed=min(max(share, 0.0), 1.0))

    def say(self, line: str) -> bool:
        """Write a line above the bar; return whether there is one."""
        if self._shown is not None:
            self._shown[0].console.print(line, markup=False, highlight=False)
        return self._shown is not None

    def close(self) -> None:
        """Take the bar away."""
        if self._shown is not None:
            self._shown[0].stop()
            self._shown = None


def _begin(text: str) -> tuple[Progress, TaskID]:
    from rich.console import Console  # noqa: PLC0415 - a command without a bar need not load it
    from rich.progress import (  # noqa: PLC0415 - as above
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    bar = Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=30),
        TaskProgressColumn(),
        TimeRemainingColumn(compact=True),
        console=Console(stderr=True),
        transient=True,
    )
    bar.start()
    return bar, bar.add_task(text, total=None)
