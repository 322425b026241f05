"""The common part of every relay board: open, switch, make safe, close.

Each board adds its commands: for the first contact, for switching, and for making safe.
"""

from __future__ import annotations

import atexit
import contextlib
import threading
from collections.abc import Callable

from drivers.errors import AbortedError, DeviceTimeoutError, DriverError
from drivers.relay.serial_port import SerialPort
from drivers.valve import ValveReport

SAFE_WAIT_S = 0.3
"""Longest wait for the line when the vacuum must go on; a conversation looks up every 10 ms."""


class RelayBoard:
    """A valve on one serial port.

    ``off_command`` switches the vacuum on whatever the board received before; it is sent when
    nothing else works.
    """

    def __init__(self, port: SerialPort, off_command: bytes) -> None:
        self._port = port
        self._off_command = off_command
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
            atexit.register(self._send_off)
            try:
                self._greet()
            except BaseException:
                self._send_off()
                self._close_port()
                raise

    def hold(self) -> ValveReport:
        """Switch the vacuum on; confirmed if the board can be read back."""
        return self._switch(vacuum_on=True)

    def release(self, permitted: Callable[[], bool] | None = None) -> ValveReport:
        """Break the vacuum: the sphere falls.

        Parameters
        ----------
        permitted : callable, optional
            Asked once the line is ours; ``False`` keeps the vacuum on.

        Raises
        ------
        AbortedError
            If it was not permitted any more, or `ensure_safe` cut in.

        Notes
        -----
        Whoever withdraws the permission and then calls `ensure_safe` has the last word: this thread
        either asks after the withdrawal, or holds the line, and then `ensure_safe` cuts it short
        before its command goes out or switches the vacuum on behind it.
        """
        with self._lock:
            if permitted is not None and not permitted():
                raise AbortedError("The release was called off before it was sent.")
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
        """Check which board it is, as far as it tells, and switch the vacuum on."""
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
                self._send_off()
                raise

    def _line_held(self) -> DeviceTimeoutError:
        """Return the error for a line that another command holds although it was told to stop."""
        return DeviceTimeoutError(
            f"Another command holds the relay board's line for more than {SAFE_WAIT_S} s; the "
            "vacuum was switched on over it, unconfirmed.",
            why="The board takes no bytes, or the computer is overloaded.",
            remedy="Look at the sphere; if it hangs on a dead line, switch the board off by hand.",
        )

    def _require_open(self) -> None:
        if not self._port.is_open:
            raise DriverError(
                "The relay board's port is not open.", remedy="Call ensure_ready first."
            )

    def _send_off(self) -> None:
        """Send the safe command without waiting for anything; the error that led here counts."""
        with contextlib.suppress(DriverError):
            self._port.write(self._off_command)

    def _close_port(self) -> None:
        self._port.close()
        atexit.unregister(self._send_off)
