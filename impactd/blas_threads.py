"""One thread for each linear-algebra library: our matrices are small, our processes are many."""

from __future__ import annotations

import os

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def environment() -> dict[str, str]:
    """Return the variables that a process must have before it imports numpy."""
    return dict.fromkeys(VARIABLES, "1")


def keep_to_one() -> None:
    """Have BLAS start no threads of its own; what the environment already says is kept.

    A fit multiplies thousands of matrices of ten columns. Threads that wait for one another at each
    of them made a joint fit of 54 shots take 4.7 s instead of 0.8 s on two busy cores, and they are
    taken from the sample stream. Work is spread over processes instead.

    The libraries read the environment when numpy is imported, so this comes first in every process:
    in `impactd.cli.main` and `impactd.jobs.worker.main`, both of which import numpy only later.
    Children inherit it; `impactd.jobs.executors` tells a cluster's own workers.
    """
    for name, value in environment().items():
        os.environ.setdefault(name, value)
