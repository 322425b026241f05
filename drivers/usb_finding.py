"""Finds one board among all that are on the bus."""

from __future__ import annotations

from typing import Any

import usb.backend.libusb1
import usb.core
import usb.util

from drivers.errors import ConfigurationError
from drivers.usb_errors import no_libusb, translated


def usable_backend(backend: Any) -> Any:
    """Return the backend, or libusb for ``None``; ConfigurationError if that is not installed."""
    backend = backend or usb.backend.libusb1.get_backend()
    if backend is None:
        raise no_libusb()
    return backend


def find_boards(backend: Any, vendor_id: int, product_id: int) -> list[Any]:
    """Return all boards with these ids."""
    with translated("looking for the digitizer"):
        return list(
            usb.core.find(find_all=True, backend=backend, idVendor=vendor_id, idProduct=product_id)
        )


def serial_number_of(device: Any) -> str | None:
    """Return the serial number a board states, if it states one."""
    if not device.iSerialNumber:
        return None
    with translated("reading the serial number"):
        try:
            text = usb.util.get_string(device, device.iSerialNumber)
        except ValueError:  # pyusb's word for "no language", mostly missing permission
            return None
    return None if text is None else str(text)


def choose_board(devices: list[Any], serial_number: str | None) -> Any:
    """Return the board with a serial number, or the only one; None if there is none.

    A ConfigurationError says that several remain.
    """
    if serial_number is not None:
        devices = [d for d in devices if serial_number_of(d) == serial_number]
    if len(devices) > 1:
        raise ConfigurationError(
            f"{len(devices)} digitizers answer to the same ids.",
            remedy="Set serial_number in the digitizer section of the settings.",
        )
    return devices[0] if devices else None
