"""Ids, vendor requests, status bits and scan parameters of the USB-2637.

The sources are in this folder's README: the maker's `uldaq` and Warren Jasper's `mcc-libusb`.
Untested on a board.
"""

from __future__ import annotations

import struct
from enum import IntEnum, IntFlag

VENDOR_ID = 0x09DB
PRODUCT_ID = 0x0119
ENDPOINT_IN = 0x86

CHANNELS = 64
RANGE_V = 10.0
"""The only input range that the maker's library offers, +/-."""
PACER_CLOCK_HZ = 64.0e6
FASTEST_DIVISOR = 63
"""64 MHz / 64 = 1 MHz, the converter's limit."""
SLOWEST_DIVISOR = 24_999
"""2560 Hz: a packet has 256 samples, and one must arrive within each read of 0.1 s."""

FPGA_UNLOCK = b"\xad"
FPGA_BLOCK_BYTES = 64
CALIBRATION_ADDRESS = 0x7500

_PACKET_SAMPLES = 256
_RANGE_10_V = 0


class Request(IntEnum):
    """Vendor requests on endpoint 0 (0x40 out, 0xC0 in)."""

    SCAN_START = 0x12
    SCAN_STOP = 0x13
    SCAN_LIST = 0x14
    CLEAR_FIFO = 0x15
    MEMORY = 0x30
    MEMORY_ADDRESS = 0x31
    STATUS = 0x40
    FPGA_CONFIG = 0x50
    FPGA_DATA = 0x51
    FPGA_VERSION = 0x52


class Status(IntFlag):
    """Bits of the status word."""

    SCAN_RUNNING = 0x0002
    SCAN_OVERRUN = 0x0004
    OUTPUT_RUNNING = 0x0008
    OUTPUT_UNDERRUN = 0x0010
    SCAN_DONE = 0x0020
    OUTPUT_DONE = 0x0040
    FPGA_CONFIGURED = 0x0100
    FPGA_CONFIG_MODE = 0x0200


def scan_list(channels: list[int]) -> bytes:
    """Return the scan list of some channels at +/-10 V: 64 bytes, those behind the list are 0."""
    entries = bytes(_RANGE_10_V << 6 | channel for channel in channels)
    return entries.ljust(CHANNELS, b"\x00")


def scan_start(divisor: int) -> bytes:
    """Return the parameters of a scan without end, trigger or burst, in packets of 512 bytes.

    Scans (0 for no end), scans per trigger, divisor, samples per packet less one, options.
    """
    return struct.pack("<IIIBB", 0, 0, divisor, _PACKET_SAMPLES - 1, 0)


def pacer_rate_hz(divisor: int) -> float:
    r"""Return the nominal sample rate of a pacer divisor.

    .. math:: f = 64\,\mathrm{MHz} / (N + 1)
    """
    return PACER_CLOCK_HZ / (divisor + 1)
