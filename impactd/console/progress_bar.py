"""How far a long command is: a bar on a terminal, nothing in a pipe, or a line for each step."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from analysis.diagnosis.progress import each_step

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

_shown: list[tuple[Progress, TaskID]] = []
"""The bar that is on the screen, if any: a terminal has one last line."""


def progress(text: str, *, share: float | None = None, last: bool = False) -> None:
    """Show what is being done, and how much of it is done where that is known.

    Parameters
    ----------
    text : str
        What is being done.
    share : float, optional
        Between 0 and 1; with it a bar and the time that is left are shown.
    last : bool, optional
        Takes the bar away again; nothing is shown then.

    Notes
    -----
    On standard error, and only where that is a terminal; `rich` honours ``NO_COLOR`` and ``TERM``.
    """
    if last:
        while _shown:
            _shown.pop()[0].stop()
        return
    if not sys.stderr.isatty():
        return
    if not _shown:
        _shown.append(_begin(text))
    bar, task = _shown[0]
    bar.update(task, description=text, total=None if share is None else 1.0)
    if share is not None:
        bar.update(task, completed=min(max(share, 0.0), 1.0))


def progress_by_step() -> Callable[[str, float | None], None]:
    """Return what to tell how far a command of minutes is.

    Returns
    -------
    callable
        Gets what is being done, its step before the first colon, and the share that is done, if
        that is known. On a terminal it moves the bar; elsewhere, as in a log, the first words of
        each step are a line on standard error.
    """
    if sys.stderr.isatty():
        return lambda text, share: progress(text, share=share)
    return each_step(lambda line: print(line, file=sys.stderr, flush=True))


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
