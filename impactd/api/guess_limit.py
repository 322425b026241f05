"""How many wrong sign-in codes are read in a minute; the numbers are in `sign_in_codes`."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

_MINUTE_S = 60.0
# A person mistypes a code as often as a token; see `failed_logins`.
_PER_ADDRESS = 5
# Six addresses with all their guesses. It also limits what is kept of addresses.
_IN_ALL = 30


class GuessLimit:
    """Wrong codes of the present minute; used in the event loop's thread only."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._began_s = now_s()
        self._wrong: Counter[str] = Counter()

    def wait_s(self, address: str) -> float:
        """Return how long an address must wait for its next guess, 0 if it may guess now. [s]"""
        left_s = self._began_s + _MINUTE_S - self._now_s()
        if left_s <= 0:
            self._began_s, left_s = self._now_s(), _MINUTE_S
            self._wrong.clear()
        full = self._wrong[address] >= _PER_ADDRESS or self._wrong.total() >= _IN_ALL
        return left_s if full else 0.0

    def note(self, address: str) -> None:
        """Count a wrong code."""
        self._wrong[address] += 1
