"""A Numato Lab USB relay board that switches the vacuum, with read-back and a vacuum gauge.

ASCII over a serial port. Sources disagree about line ends, so both are stripped; the reply to a bad
command is not known, so words that are no reply are an error and never taken for one.
"""

from __future__ import annotations

import atexit
import contextlib
import re
import threading
import time
from dataclasses import dataclass

from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DisobeyedError,
    DriverError,
    ProtocolError,
)
from drivers.relay.serial_port import SerialPort
from drivers.valve import VacuumReading, ValveReport

_POLL_S = 0.01
_SAFE_WAIT_S = 0.3


@dataclass(frozen=True)
class NumatoSettings:
    """Where the board is and how its gauge is calibrated.

    Attributes
    ----------
    port : str
        Device path, better one under ``/dev/serial/by-id``.
    relay : int
        Channel of the valve. [1]
    adc_channel : int or None
        Channel of the vacuum gauge, ``None`` without one. [1]
    adc_volts_per_code : float or None
        Calibrated step; the board's reference voltage is not documented. [V]
    held_threshold_v : float or None
        Gauge voltage between "sphere held" and "not held". [V]
    held_above : bool
        Whether a held sphere reads above the threshold.
    timeout_s : float
        For one reply. [s]
    """

    port: str
    relay: int = 0
    adc_channel: int | None = None
    adc_volts_per_code: float | None = None
    held_threshold_v: float | None = None
    held_above: bool = True
    timeout_s: float = 0.5

    def __post_init__(self) -> None:
        """Refuse a gauge without its calibration."""
        calibration = (self.adc_volts_per_code, self.held_threshold_v)
        if self.adc_channel is not None and None in calibration:
            raise ConfigurationError(
                "A vacuum gauge is configured without adc_volts_per_code and held_threshold_v.",
                why="The board's reference voltage is not documented.",
                remedy="Measure both once and write them into the settings, or set no adc_channel.",
            )


class NumatoValve:
    """The valve of `drivers.valve.Valve` on a Numato board.

    Parameters
    ----------
    settings : NumatoSettings
        Where the board is.
    """

    def __init__(self, settings: NumatoSettings) -> None:
        self._settings = settings
        self._port = SerialPort(settings.port, settings.timeout_s)
        self._lock = threading.RLock()
        self._hurry = threading.Event()
        self._identity = ""
        self._sent_ns = 0

    @property
    def identity(self) -> str:
        """Return the board's own words about itself."""
        return self._identity or f"Numato relay board at {self._settings.port}, not opened yet"

    @property
    def can_confirm(self) -> bool:
        """Return True: commands are read back."""
        return True

    def ensure_ready(self) -> None:
        """Open the port exclusively, clear its line, and switch the vacuum on.

        Raises
        ------
        DeviceNotFoundError, DeviceBusyError
            If the port cannot be opened.
        DriverError
            If the board does not answer as a Numato board does.
        """
        with self._lock:
            if self._port.is_open:
                return
            self._port.open()
            atexit.register(self._at_exit)
            self._hurry.clear()
            try:
                # A bare CR ends whatever half a command the last user left behind.
                self._port.write(b"\r")
                self._port.discard(_POLL_S)
                version, _ = self._ask("ver", rb"([0-9A-Za-z.]+)")
                name, _ = self._ask("id get", rb"([0-9A-Za-z]+)")
                self._identity = f"Numato relay board, version {version}, id {name}"
                self._command(vacuum_on=True)
            except BaseException:
                self._last_words()
                self._close_port()
                raise

    def hold(self) -> ValveReport:
        """Switch the vacuum on.

        Returns
        -------
        ValveReport
            Confirmed by reading the relay back.
        """
        return self._switch(vacuum_on=True)

    def release(self) -> ValveReport:
        """Break the vacuum: the sphere falls.

        Returns
        -------
        ValveReport
            Confirmed by reading the relay back.
        """
        return self._switch(vacuum_on=False)

    def vacuum(self) -> VacuumReading | None:
        """Return the gauge, ``None`` where none is configured."""
        s = self._settings
        if s.adc_channel is None or s.adc_volts_per_code is None or s.held_threshold_v is None:
            return None
        with self._lock:
            self._require_open()
            text, _ = self._ask(f"adc read {s.adc_channel}", rb"(\d{1,4})")
        code = int(text)
        if code > 1023:
            raise ProtocolError(f"The relay board's converter has 10 bits and answered {code}.")
        volts = code * s.adc_volts_per_code
        return VacuumReading(code, volts, (volts > s.held_threshold_v) == s.held_above)

    def ensure_safe(self) -> None:
        """Switch the vacuum on by whatever still works; do nothing on a port never opened.

        A conversation another thread is having is cut short: that thread gets an AbortedError.
        A port that went away is opened again.

        Raises
        ------
        DriverError
            If it could not be confirmed: somebody must look at the valve.
        """
        if self._port.was_lost:
            self.ensure_ready()  # plugged in again, perhaps
            return
        if not self._port.is_open:
            return
        self._hurry.set()
        if not self._lock.acquire(timeout=_SAFE_WAIT_S):
            # Whoever holds the line does not let go; shout over him.
            self._port.write(self._off_words())
            return
        try:
            self._hurry.clear()
            if self._port.is_open:
                self._port.write(b"\r")
                self._port.discard(_POLL_S)
                self._command(vacuum_on=True)
        except BaseException:
            self._last_words()
            raise
        finally:
            self._lock.release()

    def close(self) -> None:
        """Make safe, then give the port back; safe to call twice.

        Raises
        ------
        DriverError
            If the safe state could not be confirmed; the port is given back nevertheless.
        """
        try:
            self.ensure_safe()
        finally:
            with self._lock:
                self._close_port()

    def _switch(self, *, vacuum_on: bool) -> ValveReport:
        with self._lock:
            self._require_open()
            try:
                return self._command(vacuum_on=vacuum_on)
            except BaseException:
                self._last_words()
                raise

    def _command(self, *, vacuum_on: bool) -> ValveReport:
        """Send one command and read the relay back."""
        relay = self._settings.relay
        word = "off" if vacuum_on else "on"
        _, garbage = self._ask(f"relay {word} {relay}", b"()")
        sent_ns = self._sent_ns
        state, more = self._ask(f"relay read {relay}", rb"(on|off)")
        if state != word:
            raise DisobeyedError(
                f"Relay {relay} was told {word!r} and reads back {state!r}.",
                why="It is stuck, or another program talks to the board.",
                remedy="Take the sphere off by hand, switch the board off and check the relay.",
            )
        return ValveReport(vacuum_on, True, sent_ns, garbage + more)

    def _ask(self, command: str, reply: bytes) -> tuple[str, bytes]:
        """Send a command; return the word its reply must be, and the bytes that belong to none."""
        stale = self._port.discard(0.0)
        self._port.write(command.encode("ascii") + b"\r")
        self._sent_ns = time.monotonic_ns()
        whole = re.compile(
            rb"(?P<before>.*?)" + re.escape(command.encode("ascii")) + rb"(?P<middle>.*?)>",
            re.DOTALL | re.IGNORECASE,
        )
        exact = re.compile(reply, re.IGNORECASE)
        heard = b""
        deadline = time.monotonic() + self._settings.timeout_s
        while True:
            if self._hurry.is_set():
                raise AbortedError(
                    f"The command {command!r} was cut short: the valve is made safe."
                )
            heard += self._port.read(min(_POLL_S, self._settings.timeout_s))
            found = whole.search(heard)
            if found:
                said = bytes(b for b in found["middle"] if 32 <= b < 127).strip()
                noise = bytes(b for b in found["middle"] if not 32 <= b < 127 and b not in b"\r\n")
                answer = exact.fullmatch(said)
                if answer:
                    return answer[1].decode("ascii").lower(), stale + found["before"].strip(
                        b"\r\n>"
                    ) + noise
                if said:
                    raise ProtocolError(
                        f"The relay board answered {said[:60]!r} to {command!r}.",
                        why="It does not know the command, or it is no Numato board.",
                        remedy="Check the port in the settings and the board's model.",
                    )
            if time.monotonic() > deadline:
                raise self._port.silence(command, heard)

    def _require_open(self) -> None:
        if not self._port.is_open:
            raise DriverError(
                "The relay board's port is not open.", remedy="Call ensure_ready first."
            )

    def _off_words(self) -> bytes:
        return f"\rrelay off {self._settings.relay}\r".encode("ascii")

    def _last_words(self) -> None:
        """Send the safe command without waiting for anything; the error that led here counts."""
        with contextlib.suppress(DriverError):
            self._port.write(self._off_words())

    def _close_port(self) -> None:
        self._port.close()
        atexit.unregister(self._at_exit)

    def _at_exit(self) -> None:
        self._last_words()
