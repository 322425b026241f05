"""Units as people and instruments write them."""

from __future__ import annotations

import re
from dataclasses import dataclass

STANDARD_GRAVITY_M_PER_S2 = 9.80665
"""One g of an accelerometer's sheet. [m/s^2]"""
POUND_FORCE_N = 4.4482216152605
"""One pound-force; exact by definition. [N]"""


@dataclass(frozen=True)
class Unit:
    """The quantity and the unit of a channel."""

    quantity: str
    """``voltage``, ``force_N`` or ``acceleration_m_per_s2``, as the campaign format has them."""
    factor: float
    """One of this unit in the quantity's own unit."""
    said: str | None = None
    """What the campaign format cannot say and a reader must know."""


_STRAIN = (
    "The campaign format has no strain: the shots are stored as voltage, and 1 V stands for a "
    "strain of 1e-6; compliance_m_per_V and hsd_N_per_V are then per microstrain."
)
_ACCELERATION = "acceleration_m_per_s2"
_UNITS = {
    "v": Unit("voltage", 1.0),
    "mv": Unit("voltage", 1e-3),
    "uv": Unit("voltage", 1e-6),
    "n": Unit("force_N", 1.0),
    "mn": Unit("force_N", 1e-3),
    "kn": Unit("force_N", 1e3),
    "lbf": Unit("force_N", POUND_FORCE_N),
    "g": Unit(_ACCELERATION, STANDARD_GRAVITY_M_PER_S2),
    "kg": Unit(_ACCELERATION, 1e3 * STANDARD_GRAVITY_M_PER_S2),
    "m/s2": Unit(_ACCELERATION, 1.0),
    "mm/s2": Unit(_ACCELERATION, 1e-3),
    "strain": Unit("voltage", 1e6, _STRAIN),
    "ustrain": Unit("voltage", 1.0, _STRAIN),
}
_OTHER_NAMES = {
    "volt": "v",
    "volts": "v",
    "millivolt": "mv",
    "millivolts": "mv",
    "newton": "n",
    "newtons": "n",
    "force_n": "n",
    "g_n": "g",
    "gn": "g",
    "gs": "g",
    "g's": "g",
    "m/s^2": "m/s2",
    "m/s**2": "m/s2",
    "m/s/s": "m/s2",
    "m/sec2": "m/s2",
    "m/sec^2": "m/s2",
    "ms-2": "m/s2",
    "ms^-2": "m/s2",
    "m*s^-2": "m/s2",
    "m_per_s2": "m/s2",
    "m/s\u00b2": "m/s2",
    "mm/s\u00b2": "mm/s2",
    "mm/s^2": "mm/s2",
    "lb": "lbf",
    "m/m": "strain",
    "microstrain": "ustrain",
    "um/m": "ustrain",
    "ue": "ustrain",
    "\u03b5": "strain",
    "u\u03b5": "ustrain",
}
TIME_FACTORS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_TIMES = {
    **{name: name for name in TIME_FACTORS},
    "sec": "s",
    "second": "s",
    "seconds": "s",
    "msec": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "usec": "us",
    "microsecond": "us",
    "microseconds": "us",
}
_TIME_NAMES = re.compile(
    r"^(time|times|t|zeit|temps|tiempo|tempo|x[ _]?value|sec|secs|second|seconds|timestamp)$"
)


def find_unit(text: str | None) -> Unit | None:
    """Return the unit that is meant, ``None`` for one that is not known."""
    if text is None:
        return None
    plain = _plain(text)
    return _UNITS.get(_OTHER_NAMES.get(plain, plain))


def find_time_unit(text: str | None) -> str | None:
    """Return ``s``, ``ms``, ``us`` or ``ns``, ``None`` where the text is no unit of time."""
    return None if text is None else _TIMES.get(_plain(text))


def _plain(text: str) -> str:
    short = text.strip().strip("()[]{}").strip().replace(" ", "")
    short = short.replace("\u00b5", "u").replace("\u03bc", "u")  # the micro sign, and the letter mu
    return short.lower()


def split_name(text: str) -> tuple[str, str | None]:
    """Return a column's name without the unit, and the unit that it states.

    ``Force (N)``, ``a [m/s^2]``, ``time_ms`` and ``Time, s`` are understood. Only a unit of
    `find_unit` or `find_time_unit` counts.
    """
    text = text.strip().strip('"').strip()
    for pattern in (
        r"^(.*?)[\s_]*[(\[{]\s*(.+?)\s*[)\]}]\s*$",
        r"^(.*?)\s*[,/]\s*(\S+)$",
        r"^(.*?)_(m_per_s2)$",
        r"^(.*)_([^_]+)$",
        r"^(.*\S)\s+(\S+)$",
    ):
        found = re.match(pattern, text)
        if found and (find_unit(found[2]) or find_time_unit(found[2])):
            return found[1].strip() or text, found[2]
    if _plain(text) in ("volts", "volt", "newtons", "newton", "strain", "microstrain"):
        return text, text
    return text, None


def is_time_name(name: str) -> bool:
    """Return whether a column of that name holds times."""
    return _TIME_NAMES.match(name.strip().strip('"').lower()) is not None
