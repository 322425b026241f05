"""One opened board on the bus: vendor requests over endpoint 0, and its samples."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import usb.core
import usb.util

from drivers.errors import DeviceLostError, DeviceNotFoundError, ProtocolError
from drivers.usb_errors import translated
from drivers.usb_source import READ_TIMEOUT_S, SynchronousBulkSource

_OUT = 0x40
_IN = 0xC0
_INTERFACE = 0
_DRAIN_TIMEOUT_S = 0.002
_DRAIN_BYTES = 16384
_DRAIN_LIMIT_READS = 64


class UsbLink:
    """A board whose samples come from one bulk endpoint of its only interface.

    A request that takes longer than ``control_timeout_s`` fails.
    """

    def __init__(self, device: Any, endpoint: int, *, control_timeout_s: float = 0.2) -> None:
        self.device = device
        self._endpoint = endpoint
        self._control_timeout_ms = round(control_timeout_s * 1000)
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
            usb.util.claim_interface(self.device, _INTERFACE)
            configuration = self.device.get_active_configuration()
            found = usb.util.find_descriptor(
                configuration[(_INTERFACE, 0)], bEndpointAddress=self._endpoint
            )
        if found is None:
            raise DeviceNotFoundError(
                f"The board {self.device.idVendor:04x}:{self.device.idProduct:04x} has no bulk "
                f"endpoint {self._endpoint:#04x}.",
                why="It is another board, or has another firmware.",
                remedy="Check the digitizer section of the settings.",
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
        return SynchronousBulkSource(self.device, self._endpoint, timeout_s, in_use=self.in_use)

    def clear_halt(self) -> None:
        """Clear a stall of the sample endpoint."""
        with self.in_use(), translated("clearing a stall"):
            self.device.clear_halt(self._endpoint)

    def write(self, request: int, data: bytes = b"", *, value: int = 0, index: int = 0) -> None:
        """Send a vendor request; ProtocolError if the board takes fewer bytes than are sent."""
        about = f"request {request:#04x} (value {value:#06x}, index {index:#04x})"
        with self.in_use(), translated(f"sending {about}"):
            sent = self.device.ctrl_transfer(
                _OUT, request, value, index, data, self._control_timeout_ms
            )
        if sent != len(data):
            raise ProtocolError(f"Request {request:#04x} sent {sent} of {len(data)} bytes.")

    def read(self, request: int, length: int, *, value: int = 0, index: int = 0) -> bytes:
        """Return so many bytes that answer a request; ProtocolError if there are fewer."""
        about = f"request {request:#04x} (value {value:#06x}, index {index:#04x})"
        with self.in_use(), translated(f"reading {about}"):
            data = self.device.ctrl_transfer(
                _IN, request, value, index, length, self._control_timeout_ms
            )
        if len(data) != length:
            raise ProtocolError(
                f"Request {request:#04x} answered {len(data)} of {length} bytes.",
                why="The firmware on the board is not the one this driver knows.",
                remedy="Check driver and firmware in the digitizer section of the settings.",
            )
        return bytes(data)

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
            remedy="Switch the digitizer's power off and on.",
        )
