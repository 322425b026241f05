"""The simulated board's FPGA: its loading and its registers."""

from __future__ import annotations

from drivers.simulated.usb_converter import SimulatedConverter
from drivers.simulated.usb_eeprom import RANGES_V, BoardErrors

_PACER_CLOCK_HZ = 48.0e6
_BLOCK_BYTES = 2048
_MORE_THAN_ONE, _VALID, _OVERRUN, _SCANNING, _SCAN_LIST_EMPTY = 0x01, 0x02, 0x04, 0x08, 0x20


class SimulatedFpga:
    """Registers that drive the converter once the bit stream is in.

    The pacer starts only if the whole of the start sequence was sent: scan list, list running,
    endpoint enabled, transfer on. What a real board does otherwise is NOT KNOWN; this one stays
    silent, so a forgotten step shows.
    """

    def __init__(self, converter: SimulatedConverter, errors: BoardErrors, *, loaded: bool) -> None:
        self._converter = converter
        self._errors = errors
        self.loaded = loaded
        self.image = bytearray()
        self.endpoint_on = False
        self._image_ended = False
        self._words: dict[int, int] = {}
        self._scan_list: list[int] = []
        self._list_running = False
        self._dma_on = False

    def prepare(self) -> None:
        """Forget the bit stream and await another."""
        self.image = bytearray()
        self._image_ended = False
        self.loaded = False

    def take_block(self, data: bytes) -> bool:
        """Take a block of the bit stream: 2048 bytes, fewer in the last one."""
        if self._image_ended or len(data) > _BLOCK_BYTES:
            return False
        self.image += data
        self._image_ended = len(data) < _BLOCK_BYTES
        self.loaded = True
        return True

    def read_register(self, register: int) -> int:
        """Return a register's word; all ones while the bit stream is missing."""
        if not self.loaded:
            return 0xFFFF
        if register == 0x00:
            return self._status()
        return self._words.get(register, 0)

    def write_register(self, register: int, value: int) -> None:
        """Write a register's word."""
        if not self.loaded:
            return
        if register == 0x00:
            self._control(value)
        elif register == 0x01:
            self._scan_list.append(value)
        elif register == 0x58:
            self._dma_on = value == 0x0011
        else:
            self._words[register] = value

    def _status(self) -> int:
        status = 0 if self._scan_list else _SCAN_LIST_EMPTY
        status |= _OVERRUN if self._converter.overrun else 0
        if self._converter.running:
            due = self._converter.due()
            status |= _SCANNING | (_VALID if due else 0) | (_MORE_THAN_ONE if due > 1 else 0)
        return status

    def _control(self, value: int) -> None:
        if value < 0x0010:
            if value & 0x0002:
                self._converter.reset_results()
            if value & 0x0004:
                self._scan_list.clear()
        elif value in {0x0010, 0x0011}:
            self._list_running = value == 0x0011
        elif value == 0x0030:
            self._converter.stop()
        elif value == 0x0031:
            self._start()

    def _start(self) -> None:
        complete = len(self._scan_list) == 2
        if not (complete and self._list_running and self._dma_on and self.endpoint_on):
            return
        entry = self._scan_list[0] | self._scan_list[1] << 16
        words = self._words
        divisor = words.get(2, 0) | words.get(3, 0) << 16 | words.get(5, 0) << 32
        gain_code = entry >> 24 & 0x0F
        self._converter.start(
            _PACER_CLOCK_HZ / (divisor + 1),
            RANGES_V[gain_code],
            board_gain=self._errors.gain(gain_code),
            board_offset_v=self._errors.offset_v[gain_code],
        )
