"""What every relay board of this house does the same way: open, switch, make safe, close.

A board adds its words: how it is greeted, how it is told, and how it is made safe.
"""

from __future__ import annotations

import atexit
import contextlib
import threading

from drivers.errors import DriverError
from drivers.relay.serial_port import SerialPort
from drivers.valve import ValveReport


class RelayBoard:
    """A valve behind one serial port.

    Parameters
    ----------
    port : SerialPort
        Not opened yet.
    off_words : bytes
        What switches the vacuum on whatever the board heard before; sent when nothing else works.
    """

    def __init__(self, port: SerialPort, off_words: bytes) -> None:
        self._port = port
        self._off_words = off_words
        self._lock = threading.RLock()

    def ensure_ready(self) -> None:
        """Open the port exclusively and switch the vacuum on; do nothing when it is open.

        Raises
        ------
        DeviceNotFoundError, DeviceBusyError
            If the port cannot be opened.
        DriverError
            If the board does not answer as it should; the port is given back then.
        """
        with self._lock:
            if self._port.is_open:
                return
            self._port.open()
            atexit.register(self._last_words)
            try:
                self._greet()
            except BaseException:
                self._last_words()
                self._close_port()
                raise

    def hold(self) -> ValveReport:
        """Switch the vacuum on.

        Returns
        -------
        ValveReport
            Confirmed where the board can be read back.
        """
        return self._switch(vacuum_on=True)

    def release(self) -> ValveReport:
        """Break the vacuum: the sphere falls.

        Returns
        -------
        ValveReport
            Confirmed where the board can be read back.
        """
        return self._switch(vacuum_on=False)

    def ensure_safe(self) -> None:
        """Switch the vacuum on by whatever still works; do nothing on a port never opened.

        A port that went away is opened again.

        Raises
        ------
        DriverError
            If it did not work, or could not be confirmed where the board can be read back:
            somebody must look at the valve.
        """
        if self._port.was_lost:
            self.ensure_ready()  # plugged in again, perhaps
        elif self._port.is_open:
            self._make_safe()

    def close(self) -> None:
        """Make safe, then give the port back; safe to call twice.

        Raises
        ------
        DriverError
            If it could not be made safe; the port is given back nevertheless.
        """
        try:
            self.ensure_safe()
        finally:
            with self._lock:
                self._close_port()

    # What a board adds

    def _greet(self) -> None:
        """Make sure who it is, as far as it tells, and switch the vacuum on."""
        raise NotImplementedError

    def _command(self, *, vacuum_on: bool) -> ValveReport:
        """Send one command; the caller holds the lock."""
        raise NotImplementedError

    def _make_safe(self) -> None:
        """Switch the vacuum on from any thread; the port is open."""
        raise NotImplementedError

    # Inside

    def _switch(self, *, vacuum_on: bool) -> ValveReport:
        with self._lock:
            self._require_open()
            try:
                return self._command(vacuum_on=vacuum_on)
            except BaseException:
                self._last_words()
                raise

    def _require_open(self) -> None:
        if not self._port.is_open:
            raise DriverError(
                "The relay board's port is not open.", remedy="Call ensure_ready first."
            )

    def _last_words(self) -> None:
        """Send the safe command without waiting for anything; the error that led here counts."""
        with contextlib.suppress(DriverError):
            self._port.write(self._off_words)

    def _close_port(self) -> None:
        self._port.close()
        atexit.unregister(self._last_words)
