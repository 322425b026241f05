"""How a task reports its progress, wherever it runs.

In a worker process the words go to the daemon; in a cluster or a test nobody listens.
"""

from __future__ import annotations

from collections.abc import Callable

Listener = Callable[[str, float], None]

_listeners: list[Listener] = []


def listen(listener: Listener) -> None:
    """Call a function with each report of this process' tasks: a text, and the share done, 0..1."""
    _listeners.append(listener)


def report(text: str, share: float) -> None:
    """Report what the task does, and the share that is done, 0..1."""
    for listener in _listeners:
        listener(text, share)
