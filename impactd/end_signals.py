"""The signals that end the daemon: each ends it with the valve safe, whenever it arrives."""

from __future__ import annotations

import signal
from collections.abc import Callable
from types import FrameType

# SIGHUP: a closed terminal, or a habitual reload; it ends like the others, because a daemon that
# dies of it leaves the valve as it is.
_ENDING = (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)


class EndSignals:
    """Remembers that the daemon is to end, from before its first device is touched."""

    def __init__(self) -> None:
        self.arrived = False
        self._tell: Callable[[int, FrameType | None], None] | None = None

    def catch(self) -> None:
        """Replace the default action, which is to end the process at once."""
        for number in _ENDING:
            # `nohup impactd serve` wants to outlive its terminal.
            if number == signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                continue
            signal.signal(number, self._handle)

    def pass_on(self, tell: Callable[[int, FrameType | None], None]) -> None:
        """Call ``tell`` with number and frame of each from now on, and of one that came before."""
        self._tell = tell
        if self.arrived:
            tell(signal.SIGTERM, None)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self.arrived = True
        if self._tell is not None:
            self._tell(number, frame)
