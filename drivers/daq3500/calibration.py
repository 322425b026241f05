"""The calibration table in the board's EEPROM.

The table's layout was read from one Personal Daq/3001. That the seven ranges stand in the order
of the gain code, and that a 3500 has the same table, is INFERRED: untested on a 3500.
"""

from __future__ import annotations

import struct

import numpy as np

from drivers.daq3500.link import Daq3500Link
from drivers.daq3500.registers import RANGES_V, Request, gain_code
from drivers.opened_board import RangeCalibration

_HEADER = bytes((0x40, 0x01, 0x00, 0x01))
_SECTIONS = ((0x0000, 320), (0x0140, 320), (0x0280, 168))
_LARGEST_COEFFICIENT = 0.1
_CODES = 65536


def read_table(link: Daq3500Link) -> bytes:
    """Return the three calibration sections of the EEPROM in order, 808 bytes."""
    return b"".join(
        link.read(Request.CALIBRATION, size, value=offset) for offset, size in _SECTIONS
    )


def range_calibration(table: bytes, range_v: float) -> RangeCalibration:
    """Return the calibration of one range, or the nominal one with the reason.

    .. math:: V = (1 + (g_+ + g_-)/2) V_{raw} + o

    with g the table's two gain coefficients and o its offset. ``table`` is from `read_table`. The
    result is nominal and marked when the header is wrong or any coefficient is beyond 0.1: a
    doubtful table corrects nothing. A ConfigurationError says that the board has no such range.
    """
    nominal_v = 2.0 * range_v / _CODES
    index = gain_code(range_v)
    size = len(_HEADER) + 12 * len(RANGES_V)
    if len(table) < size or table[: len(_HEADER)] != _HEADER:
        found = table[: len(_HEADER)].hex(" ")
        reason = f"its header reads {found or 'nothing'}, not {_HEADER.hex(' ')}"
        return RangeCalibration(nominal_v, 0.0, calibrated=False, reason=reason)
    values = struct.unpack_from(f"<{3 * len(RANGES_V)}f", table, len(_HEADER))
    coefficients = np.array(values, dtype=np.float64).reshape(len(RANGES_V), 3)
    # A NaN compares false, so it is caught by asking for what is good.
    if not bool(np.all(np.abs(coefficients) <= _LARGEST_COEFFICIENT)):
        worst = coefficients.flat[int(np.argmax(np.nan_to_num(np.abs(coefficients), nan=np.inf)))]
        reason = f"a coefficient of {worst:.4g} is beyond {_LARGEST_COEFFICIENT}"
        return RangeCalibration(nominal_v, 0.0, calibrated=False, reason=reason)
    gain = 1.0 + 0.5 * (coefficients[index, 0] + coefficients[index, 1])
    return RangeCalibration(float(gain * nominal_v), float(coefficients[index, 2]), calibrated=True)
