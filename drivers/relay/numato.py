"""A Numato Lab USB relay board that switches the vacuum, with read-back and a vacuum gauge.

ASCII over a serial port. Sources disagree about line ends, so both are stripped; the reply to a bad
command is not known, so words that are no reply are an error and never taken for one.
"""

from __future__ import annotations

import re
import threading
import time
from dataclasses import dataclass

from drivers.errors import AbortedError, ConfigurationError, DisobeyedError, ProtocolError
from drivers.relay.board import SAFE_WAIT_S, RelayBoard
from drivers.relay.serial_port import SerialPort
from drivers.valve import VacuumReading, ValveReport

_POLL_S = 0.01
# A reply has some twenty characters; a board that babbles must not fill the memory.
_HEARD_LIMIT_BYTES = 4096


@dataclass(frozen=True)
class NumatoSettings:
    """Where the board is and how its gauge is calibrated."""

    port: str
    """Device path, better one under ``/dev/serial/by-id``."""
    relay: int = 0
    """Channel of the valve."""
    adc_channel: int | None = None
    """Channel of the vacuum gauge, ``None`` without one."""
    adc_volts_per_code: float | None = None
    """Calibrated step; the board's reference voltage is not documented."""
    held_threshold_v: float | None = None
    """Gauge voltage between "sphere held" and "not held"."""
    held_above: bool = True
    """Whether a held sphere reads above the threshold."""
    timeout_s: float = 0.5
    """For one reply."""

    def __post_init__(self) -> None:
        """Refuse a gauge without its calibration."""
        calibration = (self.adc_volts_per_code, self.held_threshold_v)
        if self.adc_channel is not None and None in calibration:
            raise ConfigurationError(
                "A vacuum gauge is configured without adc_volts_per_code and held_threshold_v.",
                why="The board's reference voltage is not documented.",
                remedy="Measure both once and write them into the settings, or set no adc_channel.",
            )


class NumatoValve(RelayBoard):
    """The valve of `drivers.valve.Valve` on a Numato board."""

    def __init__(self, settings: NumatoSettings) -> None:
        off_command = f"\rrelay off {settings.relay}\r".encode("ascii")
        super().__init__(SerialPort(settings.port, settings.timeout_s), off_command)
        self._settings = settings
        self._hurry = threading.Event()
        self._making_safe = threading.Lock()
        self._out_of_step = False
        self._identity = ""
        self._began_ns = self._sent_ns = 0

    @property
    def identity(self) -> str:
        """Return the board's own words about itself."""
        return self._identity or f"Numato relay board at {self._settings.port}, not opened yet"

    @property
    def can_confirm(self) -> bool:
        """Return True: commands are read back."""
        return True

    def vacuum(self) -> VacuumReading | None:
        """Return the gauge, ``None`` where none is configured."""
        s = self._settings
        if s.adc_channel is None or s.adc_volts_per_code is None or s.held_threshold_v is None:
            return None
        with self._lock:
            self._require_open()
            self._catch_up()
            text, _ = self._ask(f"adc read {s.adc_channel}", rb"(\d{1,4})")
        code = int(text)
        if code > 1023:
            raise ProtocolError(f"The relay board's converter has 10 bits and answered {code}.")
        volts = code * s.adc_volts_per_code
        return VacuumReading(code, volts, (volts > s.held_threshold_v) == s.held_above)

    def _greet(self) -> None:
        self._hurry.clear()
        self._out_of_step = True
        # A bare CR ends whatever half a command the last user left behind.
        self._port.write(b"\r")
        self._port.discard(_POLL_S)
        self._catch_up()
        self._command(vacuum_on=True)

    def _make_safe(self) -> None:
        """Switch the vacuum on; a conversation of another thread ends with an AbortedError."""
        # One after the other: two aborts want the same and must not cut each other short.
        with self._making_safe:
            self._cut_in()

    def _cut_in(self) -> None:
        self._hurry.set()
        if not self._lock.acquire(timeout=SAFE_WAIT_S):
            self._port.write(self._off_command)
            raise self._line_held()
        try:
            self._hurry.clear()
            if self._port.is_open:
                # First the deed, then the proof: the board may take its time to answer.
                self._port.write(self._off_command)
                self._out_of_step = True
                self._command(vacuum_on=True)
        except BaseException:
            self._send_off()
            raise
        finally:
            self._lock.release()

    def _command(self, *, vacuum_on: bool) -> ValveReport:
        """Send one command and read the relay back."""
        self._catch_up()
        relay = self._settings.relay
        word = "off" if vacuum_on else "on"
        _, garbage = self._ask(f"relay {word} {relay}", b"()")
        began_ns, sent_ns = self._began_ns, self._sent_ns
        state, more = self._ask(f"relay read {relay}", rb"(on|off)")
        if state != word:
            self._out_of_step = True
            raise DisobeyedError(
                f"Relay {relay} was told {word!r} and reads back {state!r}.",
                why="It is stuck, or another program talks to the board.",
                remedy="Take the sphere off by hand, switch the board off and check the relay.",
            )
        return ValveReport(vacuum_on, True, began_ns, sent_ns, garbage + more)

    def _catch_up(self) -> None:
        """Read late replies: one to an older question must never answer the next.

        The board answers in order, so whatever was asked before comes before these two. Two,
        because the first of them may itself be answered by a late reply of its own kind.
        """
        if not self._out_of_step:
            return
        version, _ = self._ask("ver", rb"([0-9A-Za-z.]+)")
        name, _ = self._ask("id get", rb"([0-9A-Za-z]+)")
        self._identity = f"Numato relay board, version {version}, id {name}"
        self._out_of_step = False

    def _ask(self, command: str, reply: bytes) -> tuple[str, bytes]:
        """Send a command; return the word its reply must be, and the bytes that belong to none."""
        stale = self._port.discard(0.0)
        # Until the answer is here, every later question may hear this one's.
        in_step, self._out_of_step = not self._out_of_step, True
        self._stop_if_cut_short(command)  # before a word goes out: it may be the one that releases
        self._began_ns = time.monotonic_ns()
        self._port.write(command.encode("ascii") + b"\r")
        self._sent_ns = time.monotonic_ns()
        heard = b""
        deadline = time.monotonic() + self._settings.timeout_s
        while True:
            self._stop_if_cut_short(command)
            heard = (heard + self._port.read(min(_POLL_S, self._settings.timeout_s)))[
                -_HEARD_LIMIT_BYTES:
            ]
            answer = _answer_in(heard, command, reply)
            if answer is not None:
                self._out_of_step = not in_step
                return answer[0], stale + answer[1]
            if time.monotonic() > deadline:
                raise self._port.silence(command, heard)

    def _stop_if_cut_short(self, command: str) -> None:
        if self._hurry.is_set():
            raise AbortedError(f"The command {command!r} was cut short: the valve is made safe.")


def _answer_in(heard: bytes, command: str, reply: bytes) -> tuple[str, bytes] | None:
    """Return the answer to a command and what belongs to none; ``None`` while it is not there.

    ``heard`` is everything since the command was sent, ``reply`` the pattern of the one word it
    must be; all else is a ProtocolError. The word is in small letters; the rest are stray bytes.
    """
    echo = command.encode("ascii")
    at = heard.lower().find(echo.lower())
    ends = heard.find(b">", at + len(echo)) if at >= 0 else -1
    if ends < 0:
        return None
    middle = heard[at + len(echo) : ends]
    said = bytes(b for b in middle if 32 <= b < 127).strip()
    noise = bytes(b for b in middle if not 32 <= b < 127 and b not in b"\r\n")
    answer = re.fullmatch(reply, said, re.IGNORECASE)
    if answer:
        return answer[1].decode("ascii").lower(), heard[:at].strip(b"\r\n>") + noise
    if said:
        raise ProtocolError(
            f"The relay board answered {said[:60]!r} to {command!r}.",
            why="It does not know the command, or it is no Numato board.",
            remedy="Check the port in the settings and the board's model.",
        )
    return None
