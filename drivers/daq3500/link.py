"""Vendor requests of the board: bytes and register words over endpoint 0."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import usb.core
import usb.util

from drivers.daq3500.registers import ENDPOINT_IN, INTERFACE, Register, Request
from drivers.errors import DeviceLostError, DeviceNotFoundError, ProtocolError
from drivers.usb_errors import translated
from drivers.usb_source import READ_TIMEOUT_S, SynchronousBulkSource

_OUT = 0x40
_IN = 0xC0
_CONTROL_TIMEOUT_MS = 200
_DRAIN_TIMEOUT_S = 0.002
_DRAIN_BYTES = 16384
_DRAIN_LIMIT_READS = 64


class Daq3500Link:
    """One opened board on the bus, in either enumeration state."""

    def __init__(self, device: Any) -> None:
        self.device = device
        self._using = threading.Lock()
        self._given_back = False
        self._drain_source = self.samples(_DRAIN_TIMEOUT_S)
        self._drain_buffer = usb.util.create_buffer(_DRAIN_BYTES)

    def claim(self) -> None:
        """Claim the interface, so that no other program can.

        A DeviceBusyError says that another program has it, a DeviceNotFoundError that the board
        lacks the sample endpoint.
        """
        with self.in_use(), translated("claiming the board"):
            usb.util.claim_interface(self.device, INTERFACE)
            configuration = self.device.get_active_configuration()
            found = usb.util.find_descriptor(
                configuration[(INTERFACE, 0)], bEndpointAddress=ENDPOINT_IN
            )
        if found is None:
            raise DeviceNotFoundError(
                f"The board {self.device.idVendor:04x}:{self.device.idProduct:04x} has no bulk "
                f"endpoint {ENDPOINT_IN:#04x}.",
                why="The configured product id belongs to another board or firmware.",
                remedy="Check vendor_id and product_id_loaded in the settings.",
            )

    def dispose(self) -> None:
        """Give the board back to the system, for good; tolerate that it is gone."""
        self._given_back = True
        with self._using, translated("closing the board"):
            usb.util.dispose_resources(self.device)

    @contextmanager
    def in_use(self) -> Iterator[None]:
        """Let the board be used; DeviceLostError after it was given back.

        pyusb would open and claim it again for whoever is late, without the knowledge of its next
        owner.
        """
        with self._using:
            if self._given_back:
                raise DeviceLostError(
                    "The board was given back.",
                    why="Another part of this program closed it meanwhile.",
                    remedy="Open it again.",
                )
            yield

    def samples(self, timeout_s: float = READ_TIMEOUT_S) -> SynchronousBulkSource:
        """Return the source of the sample endpoint; it fails once the board was given back.

        A read blocks for ``timeout_s`` at most.
        """
        return SynchronousBulkSource(self.device, ENDPOINT_IN, timeout_s, in_use=self.in_use)

    def clear_halt(self) -> None:
        """Clear a stall of the sample endpoint."""
        with self.in_use(), translated("clearing a stall"):
            self.device.clear_halt(ENDPOINT_IN)

    def write(self, request: Request, data: bytes = b"", *, value: int = 0, index: int = 0) -> None:
        """Send a vendor request; ProtocolError if the board takes fewer bytes than are sent."""
        about = f"request {request:#04x} (value {value:#06x}, index {index:#04x})"
        with self.in_use(), translated(f"sending {about}"):
            sent = self.device.ctrl_transfer(_OUT, request, value, index, data, _CONTROL_TIMEOUT_MS)
        if sent != len(data):
            raise ProtocolError(f"Request {request:#04x} sent {sent} of {len(data)} bytes.")

    def read(self, request: Request, length: int, *, value: int = 0, index: int = 0) -> bytes:
        """Return so many bytes that answer a request; ProtocolError if there are fewer."""
        about = f"request {request:#04x} (value {value:#06x}, index {index:#04x})"
        with self.in_use(), translated(f"reading {about}"):
            data = self.device.ctrl_transfer(
                _IN, request, value, index, length, _CONTROL_TIMEOUT_MS
            )
        if len(data) != length:
            raise ProtocolError(
                f"Request {request:#04x} answered {len(data)} of {length} bytes.",
                why="The firmware on the board is not the one this driver knows.",
                remedy="Check the firmware files in the digitizer section of the settings.",
            )
        return bytes(data)

    def write_register(self, register: Register, value: int) -> None:
        """Write a 16-bit register."""
        self.write(Request.REGISTER, value=value, index=register)

    def read_register(self, register: Register) -> int:
        """Return a 16-bit register."""
        return int.from_bytes(self.read(Request.REGISTER, 2, index=register), "little")

    def drain(self) -> None:
        """Read the sample endpoint until nothing comes.

        A ProtocolError says that it does not run dry, because the converter did not stop.
        """
        for _ in range(_DRAIN_LIMIT_READS):
            if self._drain_source.read_into(self._drain_buffer) == 0:
                return
        raise ProtocolError(
            f"The board kept sending after it was stopped ({_DRAIN_LIMIT_READS} reads).",
            why="The stop command was not obeyed.",
            remedy="Switch the digitizer's 12 V supply off and on.",
        )
