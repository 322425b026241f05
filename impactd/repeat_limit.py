"""A log filter against floods: a message that a library repeats is written once a minute."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

_EVERY_S = 60.0
# Messages are written by libraries, a few dozen; more would be a message with a value in it.
_MOST_KEPT = 256


class RepeatLimit(logging.Filter):
    """Lets each message through once a minute, with the number of its repetitions."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._now_s = now_s
        self._lock = threading.Lock()
        self._seen: dict[tuple[str, str], tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written."""
        key = (record.name, str(record.msg).partition("\n")[0])
        now_s = self._now_s()
        with self._lock:
            told_s, repeated = self._seen.get(key, (float("-inf"), 0))
            if now_s - told_s < _EVERY_S:
                self._seen[key] = (told_s, repeated + 1)
                return False
            self._seen.pop(key, None)
            while len(self._seen) >= _MOST_KEPT:
                self._seen.pop(next(iter(self._seen)))
            self._seen[key] = (now_s, 0)
        if repeated:
            record.msg = f"{record.getMessage()} (and {repeated} times before)"
            record.args = ()
        return True
