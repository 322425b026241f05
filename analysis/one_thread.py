"""Linear algebra on one thread, for whoever calls a fit from a process of their own.

A fit multiplies thousands of matrices of ten columns, and threads that wait for one another at each
of them made a diagnosis of 54 shots take 27 s instead of 2 s on two busy cores. The commands say so
in their environment before they import numpy (`impactd.blas_threads`); a notebook has imported it.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
T = TypeVar("T")


@functools.cache
def _libraries() -> ThreadpoolController:
    """Return the libraries that a fit has loaded; looking for them takes as long as a small fit."""
    return ThreadpoolController()


def on_one_thread(function: Callable[P, T]) -> Callable[P, T]:
    """Return a function during which BLAS uses no threads of its own; then it may again."""

    @functools.wraps(function)  # its own name and docstring
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        """Call it on one thread."""
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return call
