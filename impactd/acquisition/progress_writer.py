"""A thread that writes steps and events, so that the rig's thread need not wait.

The index may be locked, or its disk slow; steps of a drop and events queue up here meanwhile, in
their order. What counts (the row before the release, the shot) is written by the drop itself.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable

import structlog

_log = structlog.get_logger("impactd.acquisition")
# A drop tells about twenty things and takes at least half a second: a disk that stands still for
# its longest wait (10 s) leaves 400 of them waiting. Beyond that the newest are lost, not the drop.
_MOST_WAITING = 1000


class ProgressWriter:
    """Executes small writes in the order in which they came, in a thread of its own."""

    def __init__(self) -> None:
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(_MOST_WAITING)
        self._thread: threading.Thread | None = None
        self._starting = threading.Lock()

    def put(self, write: Callable[[], None]) -> None:
        """Queue a write; never waits and never raises."""
        try:
            self._waiting.put_nowait(write)
        except queue.Full:
            _log.warning("a step was not written: too many wait for the disk")
            return
        if self._thread is None:
            self._start()

    def drain(self, timeout_s: float) -> bool:
        """Wait until all that was put is written; return whether it was. [s]"""
        ends_s = time.monotonic() + timeout_s
        with self._waiting.all_tasks_done:
            while self._waiting.unfinished_tasks:
                left_s = ends_s - time.monotonic()
                if left_s <= 0:
                    return False
                self._waiting.all_tasks_done.wait(left_s)
        return True

    def stop(self, timeout_s: float) -> None:
        """Write what waits, within a time, then end; safe to call twice. [s]"""
        if not self.drain(timeout_s):
            _log.warning("steps were not written", waiting=self._waiting.unfinished_tasks)
        with self._starting:
            thread, self._thread = self._thread, None
        if thread is not None:
            self._waiting.put(None)
            thread.join(timeout_s)

    def _start(self) -> None:
        with self._starting:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="progress", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while True:
            write = self._waiting.get()
            try:
                if write is None:
                    return
                write()
            except Exception:  # one step that cannot be written must not stop the later ones
                _log.exception("a step could not be written")
            finally:
                self._waiting.task_done()
