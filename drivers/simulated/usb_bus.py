"""A simulated board on a bus of its own, behind pyusb's backend interface.

What every board has: enumeration, descriptors, claims, samples on a bulk endpoint, faults of cable
and endpoint. The vendor requests are the board's own.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import usb.backend
import usb.core

from drivers.simulated import usb_descriptors as descriptors
from drivers.simulated.usb_converter import SignalSource, SimulatedConverter


def _gone() -> Any:
    return usb.core.USBError("No such device (it may have been disconnected)", -4, 19)


def stall() -> Any:
    """Return the error of a request that the board refuses."""
    return usb.core.USBError("Pipe error", -9, 32)


def _timeout() -> Any:
    return usb.core.USBTimeoutError("Operation timed out", -7, 110)


@dataclass
class Plugged:
    """The board as it appeared on the bus once; a new one after each enumeration."""

    address: int
    loaded: bool
    claimed_by: _Handle | None = None


@dataclass(eq=False)
class _Handle:
    """One opening of the board."""

    plugged: Plugged


class SimulatedUsbBoard(ABC, usb.backend.IBackend):  # type: ignore[misc] # pyusb has no types
    """A board on a bus of its own; it wakes up with firmware and FPGA loaded if ``loaded``."""

    vendor_id: int
    endpoints: tuple[int, ...]
    samples_endpoint: int

    def __init__(
        self, source: SignalSource, converter: SimulatedConverter, serial_number: str, loaded: bool
    ) -> None:
        self._source = source
        self._serial_number = serial_number
        self._lock = threading.RLock()
        self._plugged = Plugged(address=2, loaded=loaded)
        self._was_unplugged = False
        self.converter = converter

    @abstractmethod
    def _product_id(self, dev: Plugged) -> int:
        """Return the id that the board shows on the bus."""

    @abstractmethod
    def _answer(self, request: int, value: int, index: int, length: int) -> bytes:
        """Return what a vendor request reads; `stall` for one that the board does not know."""

    @abstractmethod
    def _obey(self, request: int, value: int, index: int, data: bytes) -> None:
        """Do what a vendor request writes; `stall` for one that the board does not know."""

    def _speaks(self, dev: Plugged) -> bool:
        """Whether its own firmware runs, which shows endpoints and a serial number."""
        return True

    def _absent(self) -> bool:
        """Whether the board has left the bus by itself."""
        return False

    # What pyusb asks about the bus.

    def enumerate_devices(self) -> Iterator[Plugged]:
        """Return the board while it is on the bus."""
        with self._lock:
            absent = self._unplugged() or self._absent()
            return iter([] if absent else [self._plugged])

    def get_device_descriptor(self, dev: Plugged) -> Any:
        """Return the device descriptor."""
        return descriptors.device_descriptor(
            self.vendor_id,
            self._product_id(dev),
            address=dev.address,
            states_serial_number=self._speaks(dev),
        )

    def get_configuration_descriptor(self, dev: Plugged, config: int) -> Any:
        """Return the configuration descriptor."""
        if config:
            raise IndexError("one configuration")
        return descriptors.configuration_descriptor()

    def get_interface_descriptor(self, dev: Plugged, intf: int, alt: int, config: int) -> Any:
        """Return the interface descriptor."""
        if intf or alt or config:
            raise IndexError("one interface with one setting")
        return descriptors.interface_descriptor(len(self.endpoints) if self._speaks(dev) else 0)

    def get_endpoint_descriptor(
        self, dev: Plugged, ep: int, intf: int, alt: int, config: int
    ) -> Any:
        """Return an endpoint's descriptor."""
        return descriptors.endpoint_descriptor(self.endpoints[ep])

    def open_device(self, dev: Plugged) -> _Handle:
        """Open the board."""
        handle = _Handle(dev)
        self._check_present(handle)
        return handle

    def close_device(self, dev_handle: _Handle) -> None:
        """Close it, which also releases what was claimed."""
        self.release_interface(dev_handle, 0)

    def set_configuration(self, dev_handle: _Handle, config_value: int) -> None:
        """Accept the only configuration."""
        self._check_present(dev_handle)

    def get_configuration(self, dev_handle: _Handle) -> int:
        """Return the only configuration."""
        self._check_present(dev_handle)
        return 1

    def claim_interface(self, dev_handle: _Handle, intf: int) -> None:
        """Claim it for one handle."""
        with self._lock:
            self._check_present(dev_handle)
            owner = dev_handle.plugged.claimed_by
            if owner is not None and owner is not dev_handle:
                raise usb.core.USBError("Resource busy", -6, 16)
            dev_handle.plugged.claimed_by = dev_handle

    def release_interface(self, dev_handle: _Handle, intf: int) -> None:
        """Release it; pyusb's finaliser does so twice."""
        with self._lock:
            if dev_handle.plugged.claimed_by is dev_handle:
                dev_handle.plugged.claimed_by = None

    def clear_halt(self, dev_handle: _Handle, ep: int) -> None:
        """Accept."""
        self._check_present(dev_handle)

    # Transfers.

    def bulk_read(self, dev_handle: _Handle, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Return samples as they are due."""
        check = partial(self._check_stream, dev_handle)
        check()
        out = np.frombuffer(buff, dtype="<u2")
        if ep != self.samples_endpoint:
            out = out[:0]
        count = 0
        if out.size:
            count = self.converter.read_into(out, timeout / 1000.0, check)
        if count == 0:
            raise _timeout()
        return 2 * count

    def ctrl_transfer(  # noqa: PLR0917 - pyusb's signature
        self,
        dev_handle: _Handle,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> int:
        """Answer a standard or vendor request."""
        with self._lock:
            self._check_present(dev_handle)
            if bmRequestType & 0x80:
                if (bmRequestType, bRequest) == (0x80, 0x06):
                    answer = self._string(wValue)
                else:
                    answer = self._answer(bRequest, wValue, wIndex, len(data))
                answer = answer[: len(data)]
                memoryview(data).cast("B")[: len(answer)] = answer
                return len(answer)
            self._obey(bRequest, wValue, wIndex, data.tobytes())
            return len(data)

    def _string(self, value: int) -> bytes:
        if value == 0x0300:
            return bytes((4, 3, 0x09, 0x04))
        if value == 0x0300 | descriptors.SERIAL_STRING_INDEX and self._speaks(self._plugged):
            text = self._serial_number.encode("utf-16-le")
            return bytes((len(text) + 2, 3)) + text
        raise stall()

    # Faults.

    def _unplugged(self) -> bool:
        faults = self._source.faults
        at_s = faults.unplug_usb_at_s
        out = faults.usb_unplugged or (at_s is not None and self._source.clock.now_s() >= at_s)
        if out and not self._was_unplugged:
            self.converter.stop()
        if self._was_unplugged and not out:
            # Plugged in again: a new address; its own supply kept firmware and FPGA.
            self._plugged = Plugged(self._plugged.address + 1, self._plugged.loaded)
        self._was_unplugged = out
        return out

    def _check_stream(self, handle: _Handle) -> None:
        self._check_present(handle)
        if self._source.faults.stall_endpoint:
            raise stall()

    def _check_present(self, handle: _Handle) -> None:
        with self._lock:
            if self._unplugged() or handle.plugged is not self._plugged:
                raise _gone()
