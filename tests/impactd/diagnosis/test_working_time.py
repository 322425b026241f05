"""The clock of a search stands still while a kernel is compiled."""

from __future__ import annotations

import time

from numba import njit

from impactd.diagnosis.working_time import working_time


def test_compiling_takes_no_working_time() -> None:
    """A kernel is compiled in a tenth of a second; what is not compiling counts."""

    @njit
    def kernel(x: float) -> float:
        return x * x + 1.0

    begin, working = time.monotonic(), working_time()
    kernel(2.0)
    passed, counted = time.monotonic() - begin, working_time() - working
    assert 0.0 <= counted < 0.5 * passed
    begin, working = time.monotonic(), working_time()
    time.sleep(0.05)
    assert working_time() - working >= 0.05
