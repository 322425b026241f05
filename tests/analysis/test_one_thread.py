"""BLAS has one thread during a fit, and afterwards as many as before."""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

from analysis.one_thread import on_one_thread


def threads() -> set[int]:
    """Return how many threads each BLAS has."""
    np.linalg.inv(np.eye(2))
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}


def test_one_thread_during_a_call_and_as_many_as_before_after_it() -> None:
    """Also where the call raises."""

    @on_one_thread
    def counted(*, fails: bool = False) -> set[int]:
        if fails:
            raise ValueError
        return threads()

    with threadpool_limits(limits=2, user_api="blas"):
        before = threads()
        assert counted() == {1}
        assert threads() == before
        try:
            counted(fails=True)
        except ValueError:
            assert threads() == before
