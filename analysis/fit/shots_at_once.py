"""The shots of a campaign, worked on by as many threads as numba is allowed.

The compiled solver lets go of the interpreter, so threads do run side by side; a worker that has
one core of many sets ``NUMBA_NUM_THREADS=1`` and then there are none. Threads last for one call:
they cost a fifth of a millisecond, and a pool that outlived a fork would never answer again.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from numba import config

T = TypeVar("T")
R = TypeVar("R")

LEAST_ITEMS = 4
"""Below so many a thread, threads are not worth their start."""


def at_once(work: Callable[[Sequence[T]], Sequence[R]], items: Sequence[T]) -> list[R]:
    """Return what work makes of each item, in the order of the items whatever the threads.

    Parameters
    ----------
    work : callable
        Given some of the items, returns one result each, or fewer where it gives up.
    items : sequence
        E.g. shots.

    Returns
    -------
    list
        One result each; fewer where a thread gave up.
    """
    allowed: int = config.NUMBA_NUM_THREADS  # type: ignore[attr-defined]  # set by numba at import
    threads = min(allowed, len(items) // LEAST_ITEMS)
    if threads <= 1:
        return list(work(items))
    found: list[R | None] = [None] * len(items)
    with ThreadPoolExecutor(threads) as pool:
        shares = list(pool.map(work, (items[k::threads] for k in range(threads))))
    for k, share in enumerate(shares):
        if len(share) < len(items[k::threads]):
            return [r for s in shares for r in s]
        found[k::threads] = share
    return found  # type: ignore[return-value]
