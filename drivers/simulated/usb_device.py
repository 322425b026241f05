"""A simulated Personal Daq/3000 behind pyusb's backend interface, for the unchanged driver.

It encodes our reading of the protocol, written from the facts and not from the driver's code.
That the driver passes against it shows self-consistency, not that a 3500 works.
"""

from __future__ import annotations

import hashlib
import math
import time

from drivers.simulated.usb_bus import Plugged, SimulatedUsbBoard, stall
from drivers.simulated.usb_converter import SignalSource, SimulatedConverter
from drivers.simulated.usb_eeprom import BoardErrors
from drivers.simulated.usb_registers import SimulatedFpga

_PRODUCT_UNLOADED = 0x0470
_PRODUCT_LOADED = 0x2C01
_CPUCS = 0xE600
_FIRMWARE_VERSION = 0x0102


class SimulatedDaq3500(SimulatedUsbBoard):
    """A board on a bus of its own.

    With ``loaded`` it wakes up with firmware and FPGA loaded. ``errors`` are its gains and offsets,
    stated in its EEPROM; ``eeprom`` is another content than that, e.g. a damaged one. After its
    firmware is loaded it is absent from the bus for ``reenumeration_s``. The depth of its results
    FIFO, endless by default, is NOT KNOWN.
    """

    vendor_id = 0x0622
    endpoints = (0x01, 0x81, 0x82, 0x06)
    samples_endpoint = 0x82

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
        super().__init__(source, SimulatedConverter(source, fifo_samples), serial_number, loaded)
        errors = errors or BoardErrors()
        self._eeprom = errors.eeprom() if eeprom is None else eeprom
        self._reenumeration_s = reenumeration_s
        self._absent_until_s = -math.inf
        self._in_reset = False
        self._ram: dict[int, int] = {}
        self._fpga = SimulatedFpga(self.converter, errors, loaded=loaded)

    @property
    def ram(self) -> dict[int, int]:
        """Bytes loaded into the USB chip, by address."""
        return dict(self._ram)

    @property
    def fpga_sha256(self) -> str:
        """Hash of the bit stream that arrived."""
        return hashlib.sha256(self._fpga.image).hexdigest()

    def _product_id(self, dev: Plugged) -> int:
        return _PRODUCT_LOADED if dev.loaded else _PRODUCT_UNLOADED

    def _speaks(self, dev: Plugged) -> bool:
        return dev.loaded  # the bare chip shows neither endpoints nor a serial number

    def _absent(self) -> bool:
        return time.monotonic() < self._absent_until_s

    def _answer(self, request: int, value: int, index: int, length: int) -> bytes:
        loaded = self._plugged.loaded
        if loaded and request == 0xB0:
            return _FIRMWARE_VERSION.to_bytes(2, "little")
        if loaded and request == 0xB2:
            return b"\x01" if self._fpga.loaded else b"\x00"
        if loaded and request == 0xB4:
            return self._fpga.read_register(index).to_bytes(2, "little")
        if loaded and request == 0xB8:
            return self._eeprom[value : value + length]
        raise stall()

    def _obey(self, request: int, value: int, index: int, data: bytes) -> None:
        if request == 0xA0:
            self._write_ram(value, data)
        elif not self._plugged.loaded:
            raise stall()
        elif request == 0xB2:
            self._fpga.prepare()
        elif request == 0xB3:
            if not self._fpga.take_block(data):
                raise stall()
        elif request == 0xB4:
            self._fpga.write_register(index, value)
        elif request == 0xBB:
            self._fpga.endpoint_on = (value, index) == (1, 2)
        else:
            raise stall()

    def _write_ram(self, address: int, data: bytes) -> None:
        if address == _CPUCS:
            released = self._in_reset and data == b"\x00" and bool(self._ram)
            self._in_reset = data == b"\x01"
            if released:
                self._reenumerate()
            return
        if not self._in_reset:
            raise stall()
        self._ram.update(enumerate(data, start=address))

    def _reenumerate(self) -> None:
        self._plugged = Plugged(self._plugged.address + 1, loaded=True)
        self._fpga.loaded = False
        self._absent_until_s = time.monotonic() + self._reenumeration_s
