"""The calibration of the +/-10 V range in the board's EEPROM."""

from __future__ import annotations

import struct

from drivers.opened_board import RangeCalibration
from drivers.usb2637.link import Usb2637Link
from drivers.usb2637.protocol import CALIBRATION_ADDRESS, RANGE_V

_ROW = struct.Struct("<ff")
_MIDDLE = 32768
# What the maker's own calibration refuses to store (uldaq, AiUsb26xx.cpp).
_SLOPES = (0.9, 1.2)
_LARGEST_OFFSET = 10_000.0


def read_row(link: Usb2637Link) -> bytes:
    """Return slope and offset of the +/-10 V range, 8 bytes."""
    return link.read_memory(CALIBRATION_ADDRESS, _ROW.size)


def range_calibration(row: bytes) -> RangeCalibration:
    r"""Return the calibration of the +/-10 V range, or the nominal one with the reason.

    .. math:: V = (s c + o - 2^{15}) \cdot 20\,\mathrm{V} / 2^{16}

    with c the offset-binary code, s the table's slope and o its offset in codes. ``row`` is from
    `read_row`. The result is nominal and marked when one of the two is beyond what the maker's own
    calibration stores.
    """
    nominal_v = 2.0 * RANGE_V / (2 * _MIDDLE)
    slope, offset = _ROW.unpack(row)
    # A NaN compares false, so it is caught by asking for what is good.
    if not (_SLOPES[0] <= slope <= _SLOPES[1] and abs(offset) <= _LARGEST_OFFSET):
        reason = f"a slope of {slope:.4g} with an offset of {offset:.4g} codes cannot be"
        return RangeCalibration(nominal_v, 0.0, calibrated=False, reason=reason)
    offset_v = (slope * _MIDDLE + offset - _MIDDLE) * nominal_v
    return RangeCalibration(slope * nominal_v, offset_v, calibrated=True)
