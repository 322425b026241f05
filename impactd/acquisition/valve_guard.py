"""The one place where the valve opens, and the guarantee that it closes again.

::

    open(epoch, limit) ── epoch still present? ──> release ──> close() at the trigger
                                                         └──> or by a timer of its own, at the limit

Between opening and closing there is no database, no file and no lock that others hold. The timer
has a thread of its own, so the valve closes although the thread that walks the drop is stuck.
"""

from __future__ import annotations

import threading

import structlog

from drivers.valve import Valve, ValveReport
from impactd.acquisition.abort_epoch import AbortEpoch

_log = structlog.get_logger("impactd.acquisition")


class ValveGuard:
    """Opens the valve for the present epoch only, and closes it again in any case.

    The valve is connected before `open`. An abort advances the epoch before it makes the valve
    safe.
    """

    def __init__(self, valve: Valve, epoch: AbortEpoch) -> None:
        self._valve = valve
        self._epoch = epoch
        self._timer: threading.Timer | None = None

    def open(self, accepted: int, limit_s: float) -> ValveReport:
        """Break the vacuum; the valve closes by itself after ``limit_s``.

        ``accepted`` is the epoch at which the movement was asked for.

        Raises
        ------
        AbortedError
            If something was aborted since; the valve stays closed.
        DriverError
            If the valve does not follow.
        """
        # Running before the valve opens: without a thread for the timer nothing is released.
        self._timer = threading.Timer(limit_s, self._close_late, (limit_s,))
        self._timer.name = "valve-timer"
        self._timer.daemon = True
        self._timer.start()
        return self._valve.release(lambda: self._epoch.is_present(accepted))

    def is_closed(self) -> None:
        """Record that the valve was closed: the timer is not needed any more."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()

    def _close_late(self, limit_s: float) -> None:
        _log.warning("the valve was still open and is closed by its timer", after_s=limit_s)
        try:
            self._valve.ensure_safe()
        except Exception:  # the walk of the drop finds out for itself, and calls for a person
            _log.exception("the valve's timer could not close it")
