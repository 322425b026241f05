"""How a task says how far it is, wherever it runs.

In a worker process the words go to the daemon; in a cluster or a test nobody listens.
"""

from __future__ import annotations

from collections.abc import Callable

Listener = Callable[[str, float], None]

_listeners: list[Listener] = []


def listen(listener: Listener) -> None:
    """Let a function hear what tasks of this process report.

    Parameters
    ----------
    listener : callable
        Gets what is being done and the share done, 0..1.
    """
    _listeners.append(listener)


def report(text: str, share: float) -> None:
    """Say how far the task is.

    Parameters
    ----------
    share : float
        How much of it is done, 0..1.
    """
    for listener in _listeners:
        listener(text, share)
