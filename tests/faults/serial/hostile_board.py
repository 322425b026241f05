"""A relay board on a pseudo-terminal that misbehaves by script, one mishap a line."""

from __future__ import annotations

import contextlib
import os
import select
import threading
import time
import tty
from dataclasses import dataclass

OBEYS = frozenset({"well", "noise", "chatter", "no echo", "mute", "cut", "late", "twice", "flip"})
"""Mishaps of the answer only: the relay follows."""
MISHAPS = (*sorted(OBEYS), "deaf", "stuck", "reset", "unplug")


@dataclass(frozen=True)
class Mishap:
    """What goes wrong with one line.

    Attributes
    ----------
    kind : str
        One of `MISHAPS`.
    noise : bytes
        What is said besides.
    at : int
        Where the answer is cut, or which of its bits is flipped.
    """

    kind: str = "well"
    noise: bytes = b""
    at: int = 0


class HostileBoard:
    """Answers as a Numato board, except where the script says otherwise.

    Parameters
    ----------
    script : list of Mishap
        For one line after the other; behind its end all is well.
    """

    def __init__(self, script: list[Mishap]) -> None:
        self.relay_on = False
        self.turned_off_s = time.monotonic()
        self.unplugged = False
        self.refused_off = False
        self._script = list(script)
        self._stuck = False
        self._late = b""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.port = os.ttyname(self._slave)
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def heal(self) -> None:
        """Do as told from now on; what is unplugged stays so."""
        self._script.clear()
        self._stuck = False

    def close(self) -> None:
        """End."""
        self._ending.set()
        self._thread.join(10.0)
        self._drop_ends()

    def _drop_ends(self) -> None:
        ends, self._master, self._slave = (self._master, self._slave), -1, -1
        for descriptor in ends:
            if descriptor >= 0:
                os.close(descriptor)

    def _serve(self) -> None:
        pending = b""
        while not self._ending.is_set() and self._master >= 0:
            if not select.select([self._master], [], [], 0.02)[0]:
                continue
            with contextlib.suppress(OSError):
                pending += os.read(self._master, 1024)
            while b"\r" in pending and self._master >= 0:
                line, pending = pending.split(b"\r", 1)
                self._line(line, self._script.pop(0) if self._script else Mishap())

    def _line(self, line: bytes, mishap: Mishap) -> None:
        kind = mishap.kind
        if kind == "unplug":
            self.unplugged = True
            self._drop_ends()
            return
        self._stuck = self._stuck or kind == "stuck"
        off = line.strip() == b"relay off 0"
        if off:
            self.refused_off = kind == "deaf" or self._stuck
        if kind == "deaf":
            return
        answer = self._obey(line.strip().decode("latin-1"))
        if kind == "reset":  # the relay falls back and nobody says so
            self._switch(False)
            return
        echo = b"" if kind == "no echo" else line + b"\r\n\r"
        reply = echo + answer + (b"\n\r>" if answer else b">")
        self._say(reply, line, answer, mishap)

    def _say(self, reply: bytes, line: bytes, answer: bytes, mishap: Mishap) -> None:
        kind, at = mishap.kind, mishap.at
        if kind == "mute":
            return
        if kind == "late":
            self._late += reply
            return
        reply, self._late = self._late + reply, b""
        if kind == "cut":
            reply = reply[: at % len(reply)]
        elif kind == "flip":
            place = at % (8 * len(reply))
            flipped = bytearray(reply)
            flipped[place // 8] ^= 1 << place % 8
            reply = bytes(flipped)
        elif kind == "noise":
            reply = mishap.noise + reply
        elif kind == "chatter":
            reply = line + b"\r\n" + mishap.noise + answer + b"\r\n>"
        elif kind == "twice":
            reply += reply
        os.write(self._master, reply)

    def _obey(self, command: str) -> bytes:
        if command in ("relay on 0", "relay off 0"):
            self._switch(command == "relay on 0")
            return b""
        words = {"": b"", "ver": b"00000008", "id get": b"00000000", "adc read 0": b"655"}
        words["relay read 0"] = b"on" if self.relay_on else b"off"
        return words.get(command, b"invalid command")

    def _switch(self, on: bool) -> None:
        if self._stuck:
            return
        if self.relay_on and not on:
            self.turned_off_s = time.monotonic()
        self.relay_on = on
