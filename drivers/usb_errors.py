"""The one translation of pyusb's errors into the driver's errors.

pyusb raises `usb.core.USBError` with the code of its backend; the driver uses the libusb 1.0
backend only, so a code means the same everywhere. Everything above this file sees
`drivers.errors` alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import usb.core

from drivers.errors import (
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    ProtocolError,
)


class _Meaning(NamedTuple):
    """What a libusb code tells the person at the rig."""

    error: type[DriverError]
    why: str
    remedy: str


_REPLUG = "Check cable and 12 V supply, unplug and replug the board."

_MEANINGS: dict[int, _Meaning] = {
    -1: _Meaning(DeviceLostError, "The bus reported an input/output error.", _REPLUG),
    -2: _Meaning(
        ConfigurationError,
        "The board has no such endpoint, interface or transfer size.",
        "Check vendor and product ids in the digitizer section of the settings.",
    ),
    -3: _Meaning(
        ConfigurationError,
        "This user may not open the board.",
        "Install the udev rule from systemd/ and replug the board.",
    ),
    -4: _Meaning(DeviceLostError, "The board left the bus: unplugged or without power.", _REPLUG),
    -5: _Meaning(
        DeviceNotFoundError,
        "The board has no such interface or endpoint: probably another product.",
        "Check vendor and product ids in the digitizer section of the settings.",
    ),
    -6: _Meaning(
        DeviceBusyError,
        "Another program has claimed the board.",
        "Stop the other program (another impactd?) and try again.",
    ),
    -7: _Meaning(DeviceTimeoutError, "The board did not answer in time.", _REPLUG),
    -8: _Meaning(ProtocolError, "The board sent more than was asked for.", _REPLUG),
    -9: _Meaning(ProtocolError, "The board stalled: it refused the request.", _REPLUG),
    -10: _Meaning(
        DeviceTimeoutError, "A signal interrupted the transfer before it ended.", "Try again."
    ),
    -11: _Meaning(
        ConfigurationError,
        "The kernel gave no memory for the transfer.",
        "Lower transfer_bytes or raise usbcore.usbfs_memory_mb.",
    ),
    -12: _Meaning(
        ConfigurationError,
        "This system does not support the operation.",
        "Use Linux with libusb 1.0.",
    ),
    -99: _Meaning(ProtocolError, "libusb gave no reason.", _REPLUG),
}

_UNCODED = _Meaning(ProtocolError, "pyusb gave no code.", _REPLUG)


def translate(error: usb.core.USBError, doing: str) -> DriverError:
    """Return our error for one of pyusb's, to be raised from it.

    ``doing`` says what the driver was doing, e.g. ``"reading register 0x00"``.
    """
    code = error.backend_error_code
    meaning = _MEANINGS.get(code, _UNCODED) if code is not None else _UNCODED
    what = f"USB failed while {doing} (libusb code {code}, {error.strerror})."
    return meaning.error(what, why=meaning.why, remedy=meaning.remedy)


@contextmanager
def translated(doing: str) -> Iterator[None]:
    """Turn every pyusb error of the enclosed block into the DriverError of its code."""
    try:
        yield
    except usb.core.NoBackendError as error:
        raise no_libusb() from error
    except usb.core.USBError as error:
        raise translate(error, doing) from error
    except ValueError as error:
        # pyusb swallows a failing descriptor and then misses the endpoint it describes.
        raise translate(usb.core.USBError(str(error), -5), doing) from error


def no_libusb() -> ConfigurationError:
    """Return the error that says libusb is missing."""
    return ConfigurationError(
        "libusb 1.0 was not found on this machine.",
        why="pyusb needs the system library.",
        remedy="Install it (Debian: apt install libusb-1.0-0).",
    )
