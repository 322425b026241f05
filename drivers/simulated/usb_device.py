"""A simulated board behind pyusb's backend interface, for the unchanged driver.

It encodes our reading of the protocol, written from the facts and not from the driver's code.
That the driver passes against it shows self-consistency, not that a 3500 works.
"""

from __future__ import annotations

import hashlib
import math
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import usb.backend
import usb.core

from drivers.simulated import usb_descriptors as descriptors
from drivers.simulated.usb_converter import SignalSource, SimulatedConverter
from drivers.simulated.usb_eeprom import BoardErrors
from drivers.simulated.usb_registers import SimulatedFpga

_CPUCS = 0xE600
_SAMPLES_ENDPOINT = 0x82
_FIRMWARE_VERSION = 0x0102


def _gone() -> Any:
    return usb.core.USBError("No such device (it may have been disconnected)", -4, 19)


def _stall() -> Any:
    return usb.core.USBError("Pipe error", -9, 32)


def _timeout() -> Any:
    return usb.core.USBTimeoutError("Operation timed out", -7, 110)


@dataclass
class _Plugged:
    """The board as it appeared on the bus once; a new one after each enumeration."""

    address: int
    loaded: bool
    claimed_by: _Handle | None = None


@dataclass(eq=False)
class _Handle:
    """One opening of the board."""

    plugged: _Plugged


class SimulatedDaq3500(usb.backend.IBackend):  # type: ignore[misc] # pyusb has no types
    """A board on a bus of its own.

    With ``loaded`` it wakes up with firmware and FPGA loaded. ``errors`` are its gains and offsets,
    stated in its EEPROM; ``eeprom`` is another content than that, e.g. a damaged one. After its
    firmware is loaded it is absent from the bus for ``reenumeration_s``. The depth of its results
    FIFO, endless by default, is NOT KNOWN.
    """

    def __init__(
        self,
        source: SignalSource,
        *,
        loaded: bool = True,
        serial_number: str = "SIM-0001",
        errors: BoardErrors | None = None,
        eeprom: bytes | None = None,
        reenumeration_s: float = 0.2,
        fifo_samples: int | None = None,
    ) -> None:
        self._source = source
        self._serial_number = serial_number
        self._errors = errors or BoardErrors()
        self._eeprom = self._errors.eeprom() if eeprom is None else eeprom
        self._reenumeration_s = reenumeration_s
        self._lock = threading.RLock()
        self._plugged = _Plugged(address=2, loaded=loaded)
        self._absent_until_s = -math.inf
        self._was_unplugged = False
        self._in_reset = False
        self._ram: dict[int, int] = {}
        self.converter = SimulatedConverter(source, self._errors, fifo_samples)
        self._fpga = SimulatedFpga(self.converter, loaded=loaded)

    @property
    def ram(self) -> dict[int, int]:
        """Bytes loaded into the USB chip, by address."""
        return dict(self._ram)

    @property
    def fpga_sha256(self) -> str:
        """Hash of the bit stream that arrived."""
        return hashlib.sha256(self._fpga.image).hexdigest()

    # What pyusb asks about the bus.

    def enumerate_devices(self) -> Iterator[_Plugged]:
        """Return the board while it is on the bus."""
        with self._lock:
            absent = self._unplugged() or time.monotonic() < self._absent_until_s
            return iter([] if absent else [self._plugged])

    def get_device_descriptor(self, dev: _Plugged) -> Any:
        """Return the device descriptor."""
        product = descriptors.PRODUCT_LOADED if dev.loaded else descriptors.PRODUCT_UNLOADED
        return descriptors.device_descriptor(product, address=dev.address, loaded=dev.loaded)

    def get_configuration_descriptor(self, dev: _Plugged, config: int) -> Any:
        """Return the configuration descriptor."""
        if config:
            raise IndexError("one configuration")
        return descriptors.configuration_descriptor()

    def get_interface_descriptor(self, dev: _Plugged, intf: int, alt: int, config: int) -> Any:
        """Return the interface descriptor."""
        if intf or alt or config:
            raise IndexError("one interface with one setting")
        return descriptors.interface_descriptor(loaded=dev.loaded)

    def get_endpoint_descriptor(
        self, dev: _Plugged, ep: int, intf: int, alt: int, config: int
    ) -> Any:
        """Return an endpoint's descriptor."""
        return descriptors.endpoint_descriptor(ep)

    def open_device(self, dev: _Plugged) -> _Handle:
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
        if ep != _SAMPLES_ENDPOINT:
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
                answer = self._answer(bmRequestType, bRequest, wValue, wIndex, len(data))
                answer = answer[: len(data)]
                memoryview(data).cast("B")[: len(answer)] = answer
                return len(answer)
            self._obey(bRequest, wValue, wIndex, data.tobytes())
            return len(data)

    def _answer(self, kind: int, request: int, value: int, index: int, length: int) -> bytes:
        if kind == 0x80 and request == 0x06:
            return self._string(value)
        loaded = self._plugged.loaded
        if loaded and request == 0xB0:
            return _FIRMWARE_VERSION.to_bytes(2, "little")
        if loaded and request == 0xB2:
            return b"\x01" if self._fpga.loaded else b"\x00"
        if loaded and request == 0xB4:
            return self._fpga.read_register(index).to_bytes(2, "little")
        if loaded and request == 0xB8:
            return self._eeprom[value : value + length]
        raise _stall()

    def _string(self, value: int) -> bytes:
        if value == 0x0300:
            return bytes((4, 3, 0x09, 0x04))
        if value == 0x0300 | descriptors.SERIAL_STRING_INDEX and self._plugged.loaded:
            text = self._serial_number.encode("utf-16-le")
            return bytes((len(text) + 2, 3)) + text
        raise _stall()

    def _obey(self, request: int, value: int, index: int, data: bytes) -> None:
        if request == 0xA0:
            self._write_ram(value, data)
        elif not self._plugged.loaded:
            raise _stall()
        elif request == 0xB2:
            self._fpga.prepare()
        elif request == 0xB3:
            if not self._fpga.take_block(data):
                raise _stall()
        elif request == 0xB4:
            self._fpga.write_register(index, value)
        elif request == 0xBB:
            self._fpga.endpoint_on = (value, index) == (1, 2)
        else:
            raise _stall()

    def _write_ram(self, address: int, data: bytes) -> None:
        if address == _CPUCS:
            released = self._in_reset and data == b"\x00" and bool(self._ram)
            self._in_reset = data == b"\x01"
            if released:
                self._reenumerate()
            return
        if not self._in_reset:
            raise _stall()
        self._ram.update(enumerate(data, start=address))

    def _reenumerate(self) -> None:
        self._plugged = _Plugged(self._plugged.address + 1, loaded=True)
        self._fpga.loaded = False
        self._absent_until_s = time.monotonic() + self._reenumeration_s

    # Faults.

    def _unplugged(self) -> bool:
        faults = self._source.faults
        at_s = faults.unplug_usb_at_s
        out = faults.usb_unplugged or (at_s is not None and self._source.clock.now_s() >= at_s)
        if out and not self._was_unplugged:
            self.converter.stop()
        if self._was_unplugged and not out:
            # Plugged in again: a new address; the 12 V supply kept firmware and FPGA.
            self._plugged = _Plugged(self._plugged.address + 1, self._plugged.loaded)
        self._was_unplugged = out
        return out

    def _check_stream(self, handle: _Handle) -> None:
        self._check_present(handle)
        if self._source.faults.stall_endpoint:
            raise _stall()

    def _check_present(self, handle: _Handle) -> None:
        with self._lock:
            if self._unplugged() or handle.plugged is not self._plugged:
                raise _gone()
