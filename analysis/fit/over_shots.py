"""Work on each shot by itself, on all cores where that pays.

Compiled contact laws of effects run without the interpreter's lock, for two thirds of the time that
a shot takes: two cores did 54 shots 1.6 times as fast as one. The base models are so quick that
threads would only wait for one another (0.9 times as fast), and stay on one.
"""

from __future__ import annotations

import contextvars
import functools
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")

CORES = len(os.sched_getaffinity(0))
"""That this process may use."""
LEAST_SHOTS = 4
"""Of a thread, for it to be woken: that takes a tenth of a shot's time."""


@functools.cache
def _threads() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(CORES, thread_name_prefix="shots")


os.register_at_fork(after_in_child=_threads.cache_clear)  # a child has no threads of its parent's


def for_each_shot(work: Callable[[int], T], count: int, *, on_all_cores: bool) -> list[T]:
    """Return what some work makes of shots 0, 1, ..., in their order.

    The result is the same on any number of cores. What one shot raises is raised once all threads
    have ended; the work must change nothing that shots share.
    """
    cores = min(CORES, count // LEAST_SHOTS) if on_all_cores else 1
    if cores < 2:
        return [work(i) for i in range(count)]
    tasks = [
        # numpy's error state belongs to the context
        _threads().submit(contextvars.copy_context().run, _each, work, range(c, count, cores))
        for c in range(cores)
    ]
    errors = [error for task in tasks if (error := task.exception()) is not None]
    if errors:
        raise errors[0]
    found: list[T | None] = [None] * count
    for c, task in enumerate(tasks):
        found[c::cores] = task.result()
    return found  # type: ignore[return-value]


def _each(work: Callable[[int], T], rows: range) -> list[T]:
    return [work(i) for i in rows]
