"""Every way in which a task can end badly, drawn as one tree.

::

    TaskError                   a task did not give a result
    ├── TaskFailedError         it raised: asking again would give the same
    ├── WorkerLostError         its process is gone, or had to be ended
    │   ├── WorkerCrashedError  it died (a signal, an exit)
    │   ├── TaskTimeoutError    it took too long and was ended
    │   └── TaskMemoryError     it took too much memory and was ended
    ├── SchedulerLostError      the scheduler of its cluster is gone, and with it what waited there
    ├── StoppedError            the daemon is going down; the task is to run again later
    ├── TaskCancelledError      somebody asked for its end
    └── ClusterError            there is no cluster to run it on

One `WorkerLostError` is worth another try, a second one is not.
"""

from __future__ import annotations


class TaskError(Exception):
    """A task did not give a result."""


class TaskFailedError(TaskError):
    """A task raised an exception."""

    def __init__(self, kind: str, message: str) -> None:
        self.kind = kind
        self.message = message
        super().__init__(message or kind)


class WorkerLostError(TaskError):
    """The process of a task is gone, or had to be ended."""


class WorkerCrashedError(WorkerLostError):
    """The process of a task died.

    ``how`` is ``signal SIGSEGV`` or ``exit code 3``, ``last_words`` the end of its error output.
    """

    def __init__(self, how: str, last_words: str = "") -> None:
        self.how = how
        self.last_words = last_words
        said = f" It said: {last_words}" if last_words else ""
        super().__init__(f"The worker process died ({how}).{said}")


class TaskTimeoutError(WorkerLostError):
    """A task took too long and was ended."""

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        super().__init__(
            f"The fit took more than {limit_s:g} s and was ended (jobs.fit_time_limit_s)."
        )


class TaskMemoryError(WorkerLostError):
    """A task took too much memory beyond the idle process, and was ended."""

    def __init__(self, limit_bytes: int) -> None:
        self.limit_bytes = limit_bytes
        super().__init__(
            f"The fit took more than {limit_bytes / 1e6:.0f} MB and was ended "
            "(jobs.fit_memory_bytes)."
        )


class SchedulerLostError(TaskError):
    """The scheduler of a cluster is gone, and with it the task; the next one may do it."""


class StoppedError(TaskError):
    """The daemon is going down; the task is to run again later."""


class TaskCancelledError(TaskError):
    """Somebody asked for the end of a running task."""


class ClusterError(TaskError):
    """There is no cluster to run tasks on."""
