"""How far a long command is: a bar on a terminal, nothing in a pipe, or a line for each step."""

from __future__ import annotations

import sys
from collections.abc import Callable

from analysis.diagnosis.progress import each_step
from impactd.client.progress import ProgressBar

_bar = ProgressBar()
"""The bar that is on the screen, if any: a terminal has one last line."""


def progress(text: str, *, share: float | None = None, last: bool = False) -> None:
    """Show what is being done, and how much of it is done where that is known.

    Parameters
    ----------
    share : float, optional
        Between 0 and 1; with it a bar and the time that is left are shown.
    last : bool, optional
        Takes the bar away again; nothing is shown then.
    """
    if last:
        _bar.close()
    else:
        _bar.show(text, share)


def tell(line: str, *, in_a_pipe: bool = False) -> None:
    """Write a line that stays: what a person has to do now.

    Parameters
    ----------
    line : str
        On standard error, above the bar.
    in_a_pipe : bool, optional
        Also where that is no terminal, as in the log of a nightly run.
    """
    if _bar.say(line):
        return
    if in_a_pipe or sys.stderr.isatty():
        print(line, file=sys.stderr, flush=True)


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
