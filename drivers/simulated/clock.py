"""Rig time: real, accelerated, or advanced by the reader of the samples."""

from __future__ import annotations

import math
import threading
import time


class RigClock:
    """Time as the rig knows it, starting at zero.

    At a finite ``speed`` > 0 rig time is host time multiplied by it. At ``math.inf`` nothing moves
    by itself: time stands where the last sample was read, so the host sets the pace and a run is
    repeatable to the last bit.
    """

    def __init__(self, speed: float = 1.0) -> None:
        if not speed > 0.0:
            raise ValueError(f"A clock runs forward: its speed must be above 0, not {speed}.")
        self.speed = speed
        self._origin_s = time.monotonic()
        self._reached_s = 0.0
        self._moved = threading.Condition()

    @property
    def is_driven(self) -> bool:
        """Return whether reading samples moves this clock."""
        return math.isinf(self.speed)

    def now_s(self) -> float:
        """Return rig time. [s]"""
        if self.is_driven:
            return self._reached_s
        return (time.monotonic() - self._origin_s) * self.speed

    def advance_to(self, t_s: float) -> None:
        """Move a driven clock forward; a running clock ignores it."""
        if not self.is_driven:
            return
        with self._moved:
            self._reached_s = max(self._reached_s, t_s)
            self._moved.notify_all()

    def sleep_until(self, t_s: float) -> None:
        """Return once rig time has reached ``t_s``; a driven clock jumps there."""
        if self.is_driven:
            self.advance_to(t_s)
            return
        while (left := t_s - self.now_s()) > 0.0:
            time.sleep(min(left / self.speed, 0.05))
