"""A relay board on a pseudo-terminal, Numato or LCUS-1, that moves the simulated valve."""

from __future__ import annotations

import os
import select
import threading
import tty

from drivers.errors import ConfigurationError
from drivers.simulated.world import World

_ADC_CODES = 1024
_ECHO_LIMIT = 64


class RelayTerminal:
    """A relay board one can open with pySerial at `port`.

    Relay off means vacuum on, as the plumbing is built. ``kind`` is ``"numato"`` or ``"lcus"``;
    ``adc_volts_per_code`` the simulated board's true converter step; ``newline`` surrounds the
    replies of a Numato board, as boards differ.
    """

    def __init__(
        self,
        world: World,
        kind: str = "numato",
        *,
        adc_volts_per_code: float = 5.0 / 1024.0,
        newline: bytes = b"\n\r",
    ) -> None:
        if kind not in ("numato", "lcus"):
            raise ConfigurationError(f"A relay terminal is 'numato' or 'lcus', not {kind!r}.")
        self._world, self._kind = world, kind
        self._volts_per_code, self._newline = adc_volts_per_code, newline
        self._relay_on = False
        self._identity = b"00000000"
        self._master, self._slave = os.openpty()
        # Without an open slave of our own the master reads EIO between two clients.
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._wake_read, self._wake_write = os.pipe()
        self._closing = threading.Event()
        self._closed = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._serve, name="relay-terminal", daemon=True)
        self._thread.start()

    @property
    def relay_on(self) -> bool:
        """Return whether the relay has pulled (vacuum off)."""
        return self._relay_on

    def unplug(self) -> None:
        """Pull the cable: the port is gone, the relay stays as it was."""
        self._closing.set()
        with self._lock:
            if self._closed:
                return
            self._closed = True
            os.write(self._wake_write, b"x")
        if threading.current_thread() is not self._thread:
            self._thread.join(timeout=5.0)

    def close(self) -> None:
        """Give the pseudo-terminal back; safe to call twice."""
        self.unplug()

    def _serve(self) -> None:
        pending = b""
        try:
            while not self._closing.is_set():
                ready, _, _ = select.select([self._master, self._wake_read], [], [], 0.05)
                if self._world.faults.serial_cut:
                    return
                if self._master in ready:
                    try:
                        pending += os.read(self._master, 1024)
                    except OSError:
                        return
                    answer = self._numato if self._kind == "numato" else self._lcus
                    pending = answer(pending)
        finally:
            self._closing.set()
            for descriptor in (self._master, self._slave):
                os.close(descriptor)
            with self._lock:
                self._closed = True
                os.close(self._wake_read)
                os.close(self._wake_write)

    def _send(self, reply: bytes) -> None:
        faults = self._world.faults
        if not faults.serial_silent:
            os.write(self._master, faults.serial_garbage + reply)

    def _switch(self, on: bool) -> None:
        if self._world.faults.relay_stuck:
            return
        self._relay_on = on
        self._world.set_vacuum(not on)

    # -- Numato: ASCII, commands end in CR, replies end in ">" ----------------------------------

    def _numato(self, pending: bytes) -> bytes:
        while b"\r" in pending:
            line, pending = pending.split(b"\r", 1)
            answer = self._numato_answer(line.decode("ascii", "replace").strip().lower())
            reply = line + b"\r" + self._newline
            if answer:
                reply += answer.encode("ascii") + self._newline
            self._send(reply + b">")
        return pending[-_ECHO_LIMIT:]

    def _numato_answer(self, command: str) -> str:
        state = "on" if self._relay_on else "off"
        fixed = {"": "", "ver": "00000008", "id get": "00000000", "relay read 0": state}
        fixed["relay readall"] = "01" if self._relay_on else "00"
        if command in fixed:
            return fixed[command]
        if command in ("relay on 0", "relay off 0"):
            self._switch(command == "relay on 0")
            return ""
        if command == "reset":
            self._switch(False)
            return ""
        if command == "adc read 0":
            code = round(self._world.vacuum_volts() / self._volts_per_code)
            return str(min(max(code, 0), _ADC_CODES - 1))
        # What a real board says to a bad command is not known; anything it is, it is no reply.
        return "invalid command"

    # -- LCUS-1: four bytes, never an answer ----------------------------------------------------

    def _lcus(self, pending: bytes) -> bytes:
        while (at := pending.find(b"\xa0")) >= 0 and len(pending) >= at + 4:
            frame, pending = pending[at : at + 4], pending[at + 4 :]
            if frame[1] == 1 and frame[2] in (0, 1) and sum(frame[:3]) & 0xFF == frame[3]:
                self._switch(frame[2] == 1)
        return pending
