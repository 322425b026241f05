"""An LCUS-1 relay board: four bytes out, never an answer. The fallback that cannot confirm."""

from __future__ import annotations

import atexit
import contextlib
import threading
import time
from dataclasses import dataclass

from drivers.errors import DriverError
from drivers.relay.serial_port import SerialPort
from drivers.valve import VacuumReading, ValveReport

_RELAY_ON = bytes((0xA0, 0x01, 0x01, 0xA2))
_RELAY_OFF = bytes((0xA0, 0x01, 0x00, 0xA1))


@dataclass(frozen=True)
class LcusSettings:
    """Where the board is.

    Attributes
    ----------
    port : str
        Device path, better one under ``/dev/serial/by-id``.
    timeout_s : float
        For handing a command over. [s]
    """

    port: str
    timeout_s: float = 0.5


class LcusValve:
    """The valve of `drivers.valve.Valve` on an LCUS-1 board: commanded, unconfirmed.

    Parameters
    ----------
    settings : LcusSettings
        Where the board is.
    """

    def __init__(self, settings: LcusSettings) -> None:
        self._port = SerialPort(settings.port, settings.timeout_s, baud_rate=9600)
        self._path = settings.port
        self._lock = threading.RLock()

    @property
    def identity(self) -> str:
        """Return what is known: the board never says anything."""
        return f"LCUS-1 relay board at {self._path} (commanded, unconfirmed)"

    @property
    def can_confirm(self) -> bool:
        """Return False: the board never answers."""
        return False

    def ensure_ready(self) -> None:
        """Open the port exclusively and switch the vacuum on.

        Raises
        ------
        DeviceNotFoundError, DeviceBusyError
            If the port cannot be opened.
        """
        with self._lock:
            if self._port.is_open:
                return
            self._port.open()
            atexit.register(self._last_words)
            try:
                self._port.write(_RELAY_OFF)
            except BaseException:
                self._close_port()
                raise

    def hold(self) -> ValveReport:
        """Switch the vacuum on.

        Returns
        -------
        ValveReport
            Never confirmed.
        """
        return self._switch(vacuum_on=True)

    def release(self) -> ValveReport:
        """Break the vacuum: the sphere falls.

        Returns
        -------
        ValveReport
            Never confirmed.
        """
        return self._switch(vacuum_on=False)

    def vacuum(self) -> VacuumReading | None:
        """Return None: the board has no converter."""
        return None

    def ensure_safe(self) -> None:
        """Switch the vacuum on; do nothing on a port never opened.

        Raises
        ------
        DriverError
            If the command could not be handed over: somebody must look at the valve.
        """
        if self._port.was_lost:
            self.ensure_ready()  # plugged in again, perhaps
        # One write of four bytes needs no lock: the system keeps it whole.
        if self._port.is_open:
            self._port.write(_RELAY_OFF)

    def close(self) -> None:
        """Make safe, then give the port back; safe to call twice.

        Raises
        ------
        DriverError
            If the command could not be handed over; the port is given back nevertheless.
        """
        try:
            self.ensure_safe()
        finally:
            with self._lock:
                self._close_port()

    def _switch(self, *, vacuum_on: bool) -> ValveReport:
        with self._lock:
            if not self._port.is_open:
                raise DriverError(
                    "The relay board's port is not open.", remedy="Call ensure_ready first."
                )
            try:
                self._port.write(_RELAY_OFF if vacuum_on else _RELAY_ON)
            except BaseException:
                self._last_words()
                raise
            sent_ns = time.monotonic_ns()
            garbage = self._port.discard(0.0)
        return ValveReport(vacuum_on, False, sent_ns, garbage)

    def _last_words(self) -> None:
        with contextlib.suppress(DriverError):
            self._port.write(_RELAY_OFF)

    def _close_port(self) -> None:
        self._port.close()
        atexit.unregister(self._last_words)
