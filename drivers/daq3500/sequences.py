"""The register sequences that start and stop the converter.

The order of the writes is that of the public notes on the Personal Daq/3001. Whether the overrun
bits stay set until the FIFO is reset is NOT KNOWN; the driver reads them before it resets.
"""

from __future__ import annotations

import time

from drivers.daq3500.link import Daq3500Link
from drivers.daq3500.registers import (
    DMA_OFF,
    DMA_ON,
    TRIGGER_OFF,
    TRIGGER_TTL,
    AcqControl,
    Register,
    Request,
    pacer_words,
)
from drivers.daq3500.settings import Daq3500Settings
from drivers.errors import DriverError


def reset(link: Daq3500Link) -> None:
    """Stop pacer, scan list and transfer, and empty the results FIFO."""
    link.write_register(Register.TRIGGER, TRIGGER_OFF)
    link.write_register(Register.TRIGGER, TRIGGER_TTL)
    link.write_register(Register.ACQUISITION, AcqControl.PACER_OFF)
    link.write_register(Register.ACQUISITION, AcqControl.SCAN_LIST_STOP)
    link.write_register(Register.ACQUISITION, AcqControl.RESET_CONFIG_AND_RESULTS)
    link.write_register(Register.DMA_CONTROL, DMA_OFF)


def program_scan_list(link: Daq3500Link, entry: int) -> None:
    """Write the scan list, which has one channel.

    The entry is from `drivers.daq3500.registers.scan_entry`.
    """
    link.write_register(Register.ACQUISITION, AcqControl.RESET_SCAN_LIST)
    link.write_register(Register.SCAN_LIST, entry & 0xFFFF)
    link.write_register(Register.SCAN_LIST, entry >> 16)
    link.write_register(Register.ACQUISITION, AcqControl.SET_POINT_RESET)
    link.write_register(Register.ACQUISITION, AcqControl.DIGITAL_ENHANCE_OFF)
    link.write_register(Register.CONVERSION_RATE, 0)


class Daq3500Converter:
    """The converter as a `drivers.usb_stream.StreamingBoard`.

    ``pacer_on_s`` is just before and just after the pacer was told to start, on the monotonic
    clock.
    """

    def __init__(self, link: Daq3500Link, settings: Daq3500Settings) -> None:
        self._link = link
        self._entry = settings.scan_entry
        self._pacer = pacer_words(settings.pacer_divisor)
        self.pacer_on_s: tuple[float, float] | None = None

    def start_acquiring(self) -> int:
        """Start the converter and return the status word read just before its first sample.

        Its bits are `drivers.daq3500.registers.AcqStatus`.
        """
        link = self._link
        reset(link)
        link.drain()
        # The list is written for every run: NOT KNOWN whether it survives the reset.
        program_scan_list(link, self._entry)
        link.read_register(Register.ACQUISITION)
        link.write_register(Register.ACQUISITION, AcqControl.NORMAL_MODE)
        for register, word in zip(
            (Register.PACER_LOW, Register.PACER_MIDDLE, Register.PACER_HIGH),
            self._pacer,
            strict=True,
        ):
            link.write_register(register, word)
        link.write_register(Register.ACQUISITION, AcqControl.RESET_CONFIG_AND_RESULTS)
        link.write(Request.ENDPOINT_CONTROL, value=1, index=2)
        link.write_register(Register.DMA_CONTROL, DMA_ON)
        link.write_register(Register.ACQUISITION, AcqControl.SET_POINT_START)
        link.write_register(Register.ACQUISITION, AcqControl.SCAN_LIST_START)
        status = link.read_register(Register.ACQUISITION)
        before_s = time.monotonic()
        link.write_register(Register.ACQUISITION, AcqControl.PACER_ON)
        self.pacer_on_s = (before_s, time.monotonic())
        return status

    def acquisition_status(self) -> int:
        """Return the status word, see `drivers.daq3500.registers.AcqStatus`."""
        return self._link.read_register(Register.ACQUISITION)

    def stop_acquiring(self) -> None:
        """Stop the converter and read its remaining data; DriverError after two failures."""
        try:
            reset(self._link)
        except DriverError:
            # One bad transfer must not leave the converter running.
            reset(self._link)
        self._link.drain()
