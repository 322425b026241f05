"""Requests, registers and bit patterns of the Personal Daq/3000 family.

Source: public notes on the Personal Daq/3001, confirmed by an MIT-licensed vendor library and a
Linux driver of the same chip family. That a 3500 has the same map is INFERRED: untested on a 3500.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag

from drivers.errors import ConfigurationError

PACER_CLOCK_HZ = 48.0e6
RANGES_V = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
"""Input ranges, +/-, in the order of the gain code."""

ENDPOINT_IN = 0x82
MINIMUM_FIRMWARE_VERSION = 0x0100
DIGITAL_MARKS = (0xFE, 0x02, 0xFB, 0x08, 0xEF, 0x20, 0xBF, 0x80)
"""Patterns that must read back from register 0x5D."""


class Request(IntEnum):
    """Vendor requests on endpoint 0 (0x40 out, 0xC0 in)."""

    FX2_RAM = 0xA0
    FIRMWARE_VERSION = 0xB0
    FPGA = 0xB2
    FPGA_BLOCK = 0xB3
    REGISTER = 0xB4
    CALIBRATION = 0xB8
    ENDPOINT_CONTROL = 0xBB


class Register(IntEnum):
    """Registers of request 0xB4."""

    ACQUISITION = 0x00
    SCAN_LIST = 0x01
    PACER_LOW = 0x02
    PACER_MIDDLE = 0x03
    PACER_HIGH = 0x05
    UTILITY = 0x07
    CONVERSION_RATE = 0x0F
    DMA_CONTROL = 0x58
    TRIGGER = 0x59
    DIGITAL_MARK = 0x5D


class AcqControl(IntEnum):
    """Values written to the acquisition register."""

    RESET_CONFIG_AND_RESULTS = 0x0003
    RESET_SCAN_LIST = 0x0004
    SCAN_LIST_STOP = 0x0010
    SCAN_LIST_START = 0x0011
    PACER_OFF = 0x0030
    PACER_ON = 0x0031
    DIGITAL_ENHANCE_OFF = 0x0040
    SET_POINT_RESET = 0x0054
    NORMAL_MODE = 0x0060
    SET_POINT_START = 0x0071


class AcqStatus(IntFlag):
    """Bits read from the acquisition register."""

    MORE_THAN_ONE_SAMPLE = 0x0001
    VALID_DATA = 0x0002
    RESULTS_OVERRUN = 0x0004
    SCANNING = 0x0008
    CONFIG_PIPE_FULL = 0x0010
    SCAN_LIST_EMPTY = 0x0020
    ADC_NOT_READY = 0x0040
    ARBITRATION_FAILURE = 0x0080
    ADC_PACER_OVERRUN = 0x0100
    DAC_PACER_OVERRUN = 0x0200


OVERRUNS = AcqStatus.RESULTS_OVERRUN | AcqStatus.ADC_PACER_OVERRUN
ERRORS = OVERRUNS | AcqStatus.ADC_NOT_READY | AcqStatus.ARBITRATION_FAILURE

DMA_ON = 0x0011
DMA_OFF = 0x0010
TRIGGER_OFF = 0x0000
TRIGGER_TTL = 0x0010
UTILITY_OPEN = 0x0100


def gain_code(range_v: float) -> int:
    """Return the gain code of an input range: 0 for +/-10 V to 6 for +/-0.1 V.

    A ConfigurationError says that the board has no such range.
    """
    if range_v not in RANGES_V:
        raise ConfigurationError(
            f"The digitizer has no range of +/-{range_v} V.",
            remedy=f"Set range_v to one of {', '.join(str(r) for r in RANGES_V)}.",
        )
    return RANGES_V.index(range_v)


def scan_entry(*, channel: int, range_v: float, differential: bool, settling_code: int) -> int:
    """Return the 32-bit scan-list entry of the only, hence last, channel.

    The channel is 0 to 15 (0 to 7 differential); the settling code is 0 for 1 us, 1 for 5 us, 2 for
    10 us, 3 for 1 ms. All else is a ConfigurationError. E.g. 0x00000006 for channel 0, +/-10 V,
    single-ended, 1 us.
    """
    highest = 7 if differential else 15
    if not 0 <= channel <= highest:
        raise ConfigurationError(
            f"The digitizer has no {'differential ' if differential else ''}channel {channel}.",
            remedy=f"Set channel to 0 to {highest}.",
        )
    if not 0 <= settling_code <= 3:
        raise ConfigurationError(
            f"Settling code {settling_code} does not exist.",
            remedy="Set settling_code to 0 (1 us), 1 (5 us), 2 (10 us) or 3 (1 ms).",
        )
    last, always = 1 << 2, 1 << 1
    return (
        settling_code << 29
        | gain_code(range_v) << 24
        | int(differential) << 22
        | channel << 4
        | last
        | always
    )


def pacer_rate_hz(divisor: int) -> float:
    r"""Return the nominal sample rate of a pacer divisor.

    .. math:: f = 48\,\mathrm{MHz} / (N + 1)

    The calibrated rate differs (conversions were measured 1.0093 us apart where 1 us was set).
    """
    return PACER_CLOCK_HZ / (divisor + 1)


def pacer_words(divisor: int) -> tuple[int, int, int]:
    """Return the divisor N as the low, middle and high register words.

    Other than 0 to 2**48 - 1 is a ConfigurationError.
    """
    if not 0 <= divisor < 1 << 48:
        raise ConfigurationError(
            f"A pacer divisor of {divisor} does not fit the registers.",
            remedy="Set pacer_divisor to 47 for a nominal 1 MHz.",
        )
    return divisor & 0xFFFF, (divisor >> 16) & 0xFFFF, (divisor >> 32) & 0xFFFF
