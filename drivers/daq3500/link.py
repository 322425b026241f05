"""Register words of the board, in either enumeration state."""

from __future__ import annotations

from typing import Any

from drivers.daq3500.registers import ENDPOINT_IN, Register, Request
from drivers.usb_link import UsbLink


class Daq3500Link(UsbLink):
    """One opened board on the bus, in either enumeration state."""

    def __init__(self, device: Any) -> None:
        super().__init__(device, ENDPOINT_IN)

    def write_register(self, register: Register, value: int) -> None:
        """Write a 16-bit register."""
        self.write(Request.REGISTER, value=value, index=register)

    def read_register(self, register: Register) -> int:
        """Return a 16-bit register."""
        return int.from_bytes(self.read(Request.REGISTER, 2, index=register), "little")
