"""An LCUS-1 relay board: it takes four bytes and never answers, so it cannot confirm."""

from __future__ import annotations

import time
from dataclasses import dataclass

from drivers.relay.board import SAFE_WAIT_S, RelayBoard
from drivers.relay.serial_port import SerialPort
from drivers.valve import VacuumReading, ValveReport

_RELAY_ON = bytes((0xA0, 0x01, 0x01, 0xA2))
_RELAY_OFF = bytes((0xA0, 0x01, 0x00, 0xA1))
# Twice: half a frame that somebody left behind swallows the first one and not the second. A release
# is sent once, because a release that is lost hurts nobody.
_OFF_COMMAND = 2 * _RELAY_OFF


@dataclass(frozen=True)
class LcusSettings:
    """Where the board is."""

    port: str
    """Device path, better one under ``/dev/serial/by-id``."""
    timeout_s: float = 0.5
    """For handing a command over."""


class LcusValve(RelayBoard):
    """The valve of `drivers.valve.Valve` on an LCUS-1 board: commanded, unconfirmed."""

    def __init__(self, settings: LcusSettings) -> None:
        port = SerialPort(settings.port, settings.timeout_s, baud_rate=9600)
        super().__init__(port, _OFF_COMMAND)
        self._path = settings.port

    @property
    def identity(self) -> str:
        """Return what is known: the board never says anything."""
        return f"LCUS-1 relay board at {self._path} (commanded, unconfirmed)"

    @property
    def can_confirm(self) -> bool:
        """Return False: the board never answers."""
        return False

    def vacuum(self) -> VacuumReading | None:
        """Return None: the board has no converter."""
        return None

    def _greet(self) -> None:
        self._port.write(_OFF_COMMAND)

    def _command(self, *, vacuum_on: bool) -> ValveReport:
        began_ns = time.monotonic_ns()
        self._port.write(_OFF_COMMAND if vacuum_on else _RELAY_ON)
        sent_ns = time.monotonic_ns()
        return ValveReport(vacuum_on, False, began_ns, sent_ns, self._port.discard(0.0))

    def _make_safe(self) -> None:
        # At once, without a lock: the system keeps a few bytes whole. Then once more behind whoever
        # holds the line, whose "on" may be on its way.
        self._port.write(_OFF_COMMAND)
        if not self._lock.acquire(timeout=SAFE_WAIT_S):
            raise self._line_held()
        try:
            self._port.write(_OFF_COMMAND)
        finally:
            self._lock.release()
