"""A serial port with its errors translated once, for boards that talk in short lines."""

from __future__ import annotations

import contextlib
import errno
import termios
import time

import serial

from drivers.errors import (
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
)

_DRAIN_POLL_S = 0.001
# A board that babbles without end must not keep us listening.
_DISCARD_LIMIT_S = 0.1
# pySerial lets termios.error through, which is no OSError: a board unplugged while it is opened.
_PORT_ERRORS = (serial.SerialException, OSError, termios.error)
_BUSY = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)


class SerialPort:
    """One exclusive serial port.

    ``timeout_s`` is for writing. The baud rate has no meaning over USB CDC; real UARTs need it.
    """

    def __init__(self, path: str, timeout_s: float, baud_rate: int = 9600) -> None:
        self._path, self._timeout_s, self._baud_rate = path, timeout_s, baud_rate
        self._serial: serial.Serial | None = None
        self._was_lost = False

    @property
    def was_lost(self) -> bool:
        """Return whether the port went away under us and has not been opened again."""
        return self._was_lost

    @property
    def is_open(self) -> bool:
        """Return whether the port is ours."""
        return self._serial is not None

    def open(self) -> None:
        """Take the port exclusively.

        A DeviceNotFoundError says that there is no such port, a DeviceBusyError that another
        program holds it, any other DriverError that it may not be opened.
        """
        try:
            self._serial = serial.Serial(
                self._path,
                baudrate=self._baud_rate,
                timeout=0.0,
                write_timeout=self._timeout_s,
                exclusive=True,
            )
        except _PORT_ERRORS as error:
            raise self._cannot_open(error) from error
        self._was_lost = False

    def _cannot_open(self, error: Exception) -> DriverError:
        number = getattr(error, "errno", None)
        if number in _BUSY or "lock" in str(error).lower():
            return DeviceBusyError(
                f"The port {self._path} is in use.",
                why="Another program, perhaps a second daemon, holds the relay board.",
                remedy="Stop it, then try again.",
            )
        if number in (errno.EACCES, errno.EPERM):
            return DriverError(
                f"The port {self._path} may not be opened.",
                why="The user running this program is not in the port's group.",
                remedy="Install the udev rules, or add the user to the group dialout.",
            )
        return DeviceNotFoundError(
            f"There is no relay board at {self._path} ({error}).",
            why="It is unplugged, or the system gave it another name.",
            remedy="Plug it in; look under /dev/serial/by-id for its lasting name.",
        )

    def write(self, data: bytes) -> None:
        """Hand bytes over to the system and wait until they are out.

        A DeviceLostError says that the port is gone, a DeviceTimeoutError that it takes nothing any
        more.
        """
        port = self._ours()
        try:
            port.write(data)
            self._drain(port)
        except serial.SerialTimeoutException as error:
            raise DeviceTimeoutError(
                f"The relay board at {self._path} took no command within {self._timeout_s} s."
            ) from error
        except (*_PORT_ERRORS, TypeError, ValueError) as error:
            raise self._lost(error) from error

    def _drain(self, port: serial.Serial) -> None:
        """Wait until the bytes are out, but not for ever as tcdrain(3) does on a hung board."""
        deadline_s = time.monotonic() + self._timeout_s
        while port.out_waiting:
            if time.monotonic() > deadline_s:
                raise serial.SerialTimeoutException("the output queue does not empty")
            time.sleep(_DRAIN_POLL_S)

    def read(self, timeout_s: float) -> bytes:
        """Return what arrives within a time, at once if anything is there; possibly nothing.

        A DeviceLostError says that the port is gone.
        """
        port = self._ours()
        try:
            port.timeout = timeout_s
            first: bytes = port.read(1)
            return first + (port.read(port.in_waiting) if first and port.in_waiting else b"")
        except (*_PORT_ERRORS, TypeError, ValueError) as error:
            raise self._lost(error) from error

    def discard(self, timeout_s: float) -> bytes:
        """Return and forget everything that is waiting, for a tenth of a second at most.

        A silence of ``timeout_s`` ends it.
        """
        heard = b""
        ends_s = time.monotonic() + _DISCARD_LIMIT_S
        while more := self.read(timeout_s):
            heard += more
            if time.monotonic() > ends_s:
                break
        return heard

    def close(self) -> None:
        """Give the port back; safe to call twice and on a dead port."""
        self._was_lost = False
        port, self._serial = self._serial, None
        if port is not None:
            with contextlib.suppress(*_PORT_ERRORS):
                port.close()

    def silence(self, command: str, heard: bytes) -> DeviceTimeoutError:
        """Return the error for a reply that never came."""
        instead = f", only {heard[:60]!r}" if heard else ""
        return DeviceTimeoutError(
            f"The relay board at {self._path} did not answer {command!r} within "
            f"{self._timeout_s} s{instead}.",
            why="It hangs, it is another kind of board, or its cable is bad.",
            remedy="Unplug it and plug it in again.",
        )

    def _ours(self) -> serial.Serial:
        if self._serial is None:
            raise DeviceLostError(f"The port {self._path} is not open.")
        return self._serial

    def _lost(self, error: Exception) -> DeviceLostError:
        self.close()
        self._was_lost = True
        return DeviceLostError(
            f"The relay board at {self._path} is gone ({error}).",
            why="It was unplugged, or lost its power.",
            remedy="Take the sphere off, plug the board in, then acknowledge the fault.",
        )
