"""What the board is asked over endpoint 0."""

from __future__ import annotations

from typing import Any

from drivers.usb2637.protocol import ENDPOINT_IN, Request, Status
from drivers.usb_link import UsbLink


class Usb2637Link(UsbLink):
    """One opened board on the bus."""

    def __init__(self, device: Any) -> None:
        super().__init__(device, ENDPOINT_IN, control_timeout_s=1.0)  # uldaq waits as long

    def status(self) -> Status:
        """Return the status word."""
        return Status(int.from_bytes(self.read(Request.STATUS, 2), "little"))

    def read_memory(self, address: int, length: int) -> bytes:
        """Return bytes of the EEPROM, at most 64."""
        self.write(Request.MEMORY_ADDRESS, address.to_bytes(2, "little"))
        return self.read(Request.MEMORY, length)
