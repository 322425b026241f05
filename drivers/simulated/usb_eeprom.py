"""The simulated board's own errors, and the EEPROM that states them.

Written from the format alone, not from the driver's code: a misreading there must show here.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

RANGES_V = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
EEPROM_BYTES = 808


@dataclass(frozen=True)
class BoardErrors:
    """What each range's table entry says: true volts = gain * raw volts + offset."""

    gain_plus: tuple[float, ...] = (8.1e-4, -5.3e-4, 4.4e-4, 1.2e-3, -9.0e-4, 1.7e-3, 2.1e-3)
    """Gain minus one for positive volts, per range."""
    gain_minus: tuple[float, ...] = (7.7e-4, -4.9e-4, 4.0e-4, 1.0e-3, -1.1e-3, 1.5e-3, 2.3e-3)
    """The same for negative volts."""
    offset_v: tuple[float, ...] = (2.4e-3, -1.1e-3, 3.0e-4, 2.0e-4, -1.5e-4, 8e-5, -6e-5)
    """Per range."""

    def eeprom(self) -> bytes:
        """Return the EEPROM's 808 bytes; those behind the table are blank."""
        table = bytes.fromhex("40010001")
        for row in zip(self.gain_plus, self.gain_minus, self.offset_v, strict=True):
            table += struct.pack("<fff", *row)
        return table.ljust(EEPROM_BYTES, b"\xff")

    def gain(self, range_index: int) -> float:
        """Return the gain of a range, by its position in `RANGES_V`."""
        return 1.0 + (self.gain_plus[range_index] + self.gain_minus[range_index]) / 2.0


PERFECT = BoardErrors((0.0,) * 7, (0.0,) * 7, (0.0,) * 7)
"""A board whose codes are the true ones: for counting samples."""
