"""Failed authentication: logged, and slowed down when repeated."""

from __future__ import annotations

import ipaddress
import time
from collections.abc import Callable
from dataclasses import dataclass

import anyio
import structlog

_log = structlog.get_logger("impactd.security")

_MINUTE_S = 60.0
# A person mistypes a token or comes back to an old page; a program that guesses does it more often.
_FREE_PER_MINUTE = 5
# Twelve addresses with all their lines; one that changes its address must not fill the log either.
_LINES_PER_MINUTE = 60
_FIRST_DELAY_S = 0.1
_LONGEST_DELAY_S = 1.0
# Each holds a connection and some kilobytes; beyond, refusals are answered at once.
_MOST_SLEEPERS = 64
_MOST_ADDRESSES = 1024


@dataclass
class _Minute:
    """Failures of one address."""

    began_s: float
    failures: int = 0
    untold: int = 0


class FailedLogins:
    """Failures by address; used in the event loop's thread only."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._by_address: dict[str, _Minute] = {}
        self._all = _Minute(now_s())
        self._sleepers = 0

    def note(self, address: str, what: str, path: str) -> float:
        """Log a failure with a token, session or code; return how long its answer waits. [s]"""
        now_s = self._now_s()
        self._begin_minute(now_s)
        address = _printable(address)
        minute = self._by_address.pop(address, None)
        if minute is None or now_s - minute.began_s >= _MINUTE_S:
            minute = _Minute(now_s)
        while len(self._by_address) >= _MOST_ADDRESSES:
            self._by_address.pop(next(iter(self._by_address)))
        self._by_address[address] = minute
        minute.failures += 1
        self._all.failures += 1
        told = self._all.failures - self._all.untold
        if minute.failures <= _FREE_PER_MINUTE and told <= _LINES_PER_MINUTE:
            _log.warning("authentication failed", address=address, what=what, path=path[:100])
        else:
            self._all.untold += 1
        over = minute.failures - _FREE_PER_MINUTE
        return min(_LONGEST_DELAY_S, _FIRST_DELAY_S * 2.0 ** min(over - 1, 10)) if over > 0 else 0.0

    async def slow_down(self, delay_s: float) -> None:
        """Let a refusal wait; not at all while too many wait already."""
        if delay_s <= 0 or self._sleepers >= _MOST_SLEEPERS:
            return
        self._sleepers += 1
        try:
            await anyio.sleep(delay_s)
        finally:
            self._sleepers -= 1

    def summarize(self) -> None:
        """Log once a minute what was not logged one by one; called now and then."""
        self._begin_minute(self._now_s())

    def _begin_minute(self, now_s: float) -> None:
        if now_s - self._all.began_s < _MINUTE_S:
            return
        if self._all.untold:
            _log.warning("more failed authentication", times=self._all.untold)
        self._all = _Minute(now_s)


def _printable(address: str) -> str:
    """Return an address without what cannot be printed; a proxy's header may hold anything."""
    try:
        return str(ipaddress.ip_address(address))
    except ValueError:
        return "unknown"
