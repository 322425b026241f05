"""A clock that stands still while kernels are compiled: that happens once on each machine."""

from __future__ import annotations

import time

from numba.core.event import TimingListener, register

_compiling = TimingListener()  # type: ignore[no-untyped-call]
register("numba:compile", _compiling)  # type: ignore[no-untyped-call]


def working_time() -> float:
    """Return the time without that of compiling since this module was loaded. [s]"""
    return time.monotonic() - (_compiling.duration if _compiling.done else 0.0)
