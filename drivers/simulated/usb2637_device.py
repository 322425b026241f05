"""A simulated MCC USB-2637 behind pyusb's backend interface, for the unchanged driver.

It encodes our reading of the protocol, written from the facts and not from the driver's code.
That the driver passes against it shows self-consistency, not that a real board works.
"""

from __future__ import annotations

import struct

from drivers.simulated.usb_bus import Plugged, SimulatedUsbBoard, stall
from drivers.simulated.usb_converter import SignalSource, SimulatedConverter

_RANGES_V = (10.0, 5.0, 2.0, 1.0)
_MEMORY_BYTES = 0x8000
_TABLE_ADDRESS = 0x7500
_FPGA_VERSION = 0x0103
_TYPICAL_TABLE = ((1.0021, -11.5), (0.9987, 8.25), (1.0043, 3.0), (0.9969, -2.5))


class SimulatedUsb2637(SimulatedUsbBoard):
    """A board on a bus of its own.

    With ``loaded`` it wakes up with its FPGA loaded; else it takes ``fpga_bytes`` of an image.
    ``table`` has slope and offset of each range, stated in its EEPROM, which make its true volts;
    ``stated`` are other numbers in the EEPROM, e.g. damaged ones. It falls silent when more than
    ``fifo_samples`` wait for the host: the depth, endless by default, is NOT KNOWN.
    """

    vendor_id = 0x09DB
    endpoints = (0x86, 0x02)
    samples_endpoint = 0x86

    def __init__(
        self,
        source: SignalSource,
        *,
        loaded: bool = True,
        serial_number: str = "01A2B3C4",
        table: tuple[tuple[float, float], ...] = _TYPICAL_TABLE,
        stated: tuple[tuple[float, float], ...] | None = None,
        fpga_bytes: int = 1000,
        fifo_samples: int | None = None,
    ) -> None:
        converter = SimulatedConverter(source, fifo_samples, halts_at_overrun=True)
        super().__init__(source, converter, serial_number, loaded)
        self._table = table
        self._memory = bytearray(_MEMORY_BYTES)
        for row, numbers in enumerate(stated or table):
            struct.pack_into("<ff", self._memory, _TABLE_ADDRESS + 8 * row, *numbers)
        self._address = 0
        self._fpga_bytes = fpga_bytes
        self._awaits_image = False
        self.image = b""
        self.scan_list = bytes(64)
        self._last_entry = 0

    def _product_id(self, dev: Plugged) -> int:
        return 0x0119

    def _answer(self, request: int, value: int, index: int, length: int) -> bytes:
        if request == 0x40:
            return self._status().to_bytes(2, "little")
        if request == 0x30:
            first, self._address = self._address, self._address + length
            return bytes(self._memory[first : first + length])
        if request == 0x52 and self._plugged.loaded:
            return _FPGA_VERSION.to_bytes(2, "little")
        if request == 0x14 and self._plugged.loaded:
            return self.scan_list
        raise stall()

    def _obey(self, request: int, value: int, index: int, data: bytes) -> None:
        if request == 0x31 and len(data) == 2:
            self._address = int.from_bytes(data, "little")
        elif request == 0x50 and data == b"\xad":
            self._awaits_image, self.image, self._plugged.loaded = True, b"", False
        elif request == 0x51 and self._awaits_image and len(data) <= 64:
            self.image += data
            self._plugged.loaded = len(self.image) >= self._fpga_bytes
            self._awaits_image = not self._plugged.loaded
        elif self._plugged.loaded:
            self._acquire(request, value, index, data)
        else:
            raise stall()

    def _acquire(self, request: int, value: int, index: int, data: bytes) -> None:
        running = self.converter.running
        if request == 0x13:
            self.converter.stop()
        elif request == 0x15:
            self.converter.reset_results()
        elif request == 0x14 and value == 0 and len(data) == 64 and index < 64 and not running:
            self.scan_list, self._last_entry = data, index
        elif request == 0x12 and len(data) == 14 and not running:
            self._start(*struct.unpack("<IIIBB", data))
        else:
            raise stall()

    def _start(self, count: int, retrigger: int, divisor: int, packet: int, options: int) -> None:
        # One channel, without end, in whole packets: what this rig uses. All else is refused.
        if (self._last_entry, count, retrigger, packet, options) != (0, 0, 0, 255, 0):
            raise stall()
        if divisor < 63:  # what a real board does above 1 MHz is NOT KNOWN
            raise stall()
        gain_code = self.scan_list[0] >> 6
        range_v = _RANGES_V[gain_code]
        slope, offset = self._table[gain_code]
        self.converter.reset_results()
        self.converter.start(
            64.0e6 / (divisor + 1),
            range_v,
            board_gain=slope,
            board_offset_v=(slope * 32768 + offset - 32768) * range_v / 32768,
        )

    def _status(self) -> int:
        status = 0x0100 if self._plugged.loaded else 0
        status |= 0x0200 if self._awaits_image else 0
        status |= 0x0002 if self.converter.running else 0x0020
        return status | (0x0004 if self.converter.overrun else 0)
