"""Capture of everything that crosses the USB wire, as JSON lines.

`CapturingBackend` sits between pyusb and the real backend. A log holds, in order, every control
and bulk transfer and every change of what is on the bus; descriptors are noted once. With
``keep_data`` the samples are in it and `drivers.wire_replay` can play the board's part.
"""

from __future__ import annotations

import base64
import hashlib
import json
import threading
import time
from pathlib import Path
from typing import IO, Any

import usb.backend
import usb.backend.libusb1
import usb.core

from drivers.usb_errors import no_libusb

FORMAT = "impactd-wire/1"
DEVICE_FIELDS = (
    "bLength",
    "bDescriptorType",
    "bcdUSB",
    "bDeviceClass",
    "bDeviceSubClass",
    "bDeviceProtocol",
    "bMaxPacketSize0",
    "idVendor",
    "idProduct",
    "bcdDevice",
    "iManufacturer",
    "iProduct",
    "iSerialNumber",
    "bNumConfigurations",
    "address",
    "bus",
    "port_number",
    "port_numbers",
    "speed",
)
CONFIGURATION_FIELDS = (
    "bLength",
    "bDescriptorType",
    "wTotalLength",
    "bNumInterfaces",
    "bConfigurationValue",
    "iConfiguration",
    "bmAttributes",
    "bMaxPower",
    "extra_descriptors",
)
INTERFACE_FIELDS = (
    "bLength",
    "bDescriptorType",
    "bInterfaceNumber",
    "bAlternateSetting",
    "bNumEndpoints",
    "bInterfaceClass",
    "bInterfaceSubClass",
    "bInterfaceProtocol",
    "iInterface",
    "extra_descriptors",
)
ENDPOINT_FIELDS = (
    "bLength",
    "bDescriptorType",
    "bEndpointAddress",
    "bmAttributes",
    "wMaxPacketSize",
    "bInterval",
    "bRefresh",
    "bSynchAddress",
    "extra_descriptors",
)


class _Tracked:
    """A device or handle of the inner backend, with its number in the log."""

    def __init__(self, inner: Any, number: int) -> None:
        self.inner = inner
        self.number = number


class CapturingBackend(usb.backend.IBackend):  # type: ignore[misc] # pyusb has no types
    """A backend that writes down what another one does.

    A number is added to the path's name rather than overwrite a file. If ``keep_data``, bulk data
    are written too, not only their hash.
    """

    def __init__(self, path: Path, inner: Any = None, *, keep_data: bool = False) -> None:
        self._inner = inner or usb.backend.libusb1.get_backend()
        if self._inner is None:
            raise no_libusb()
        self.path = _free_name(path)
        self._keep_data = keep_data
        self._file: IO[str] | None = None
        self._lock = threading.Lock()
        self._started_s = time.monotonic()
        self._numbers: dict[tuple[int, ...], int] = {}
        self._noted: set[str] = set()
        self._on_bus: list[int] | None = None
        self._write({"kind": "log", "format": FORMAT, "data": keep_data})

    def close(self) -> None:
        """Write everything out and close the file; it is opened again when needed."""
        with self._lock:
            if self._file is not None:
                self._file.close()
                self._file = None

    def enumerate_devices(self) -> Any:
        """Return the devices on the bus and note a change."""
        found = []
        for device in self._inner.enumerate_devices():
            descriptor = self._inner.get_device_descriptor(device)
            signature = tuple(
                int(getattr(descriptor, name) or 0)
                for name in ("bus", "address", "idVendor", "idProduct")
            )
            number = self._numbers.setdefault(signature, len(self._numbers))
            found.append(_Tracked(device, number))
        on_bus = [device.number for device in found]
        if on_bus != self._on_bus:
            self._on_bus = on_bus
            self._write({"kind": "bus", "devices": on_bus})
        return iter(found)

    def get_device_descriptor(self, dev: Any) -> Any:
        """Return and note a device's descriptor."""
        descriptor = self._inner.get_device_descriptor(dev.inner)
        return self._note(descriptor, DEVICE_FIELDS, [dev.number])

    def get_configuration_descriptor(self, dev: Any, config: int) -> Any:
        """Return and note a configuration's descriptor."""
        descriptor = self._inner.get_configuration_descriptor(dev.inner, config)
        return self._note(descriptor, CONFIGURATION_FIELDS, [dev.number, config])

    def get_interface_descriptor(self, dev: Any, intf: int, alt: int, config: int) -> Any:
        """Return and note an interface's descriptor."""
        descriptor = self._inner.get_interface_descriptor(dev.inner, intf, alt, config)
        return self._note(descriptor, INTERFACE_FIELDS, [dev.number, intf, alt, config])

    def get_endpoint_descriptor(self, dev: Any, ep: int, intf: int, alt: int, config: int) -> Any:
        """Return and note an endpoint's descriptor."""
        descriptor = self._inner.get_endpoint_descriptor(dev.inner, ep, intf, alt, config)
        return self._note(descriptor, ENDPOINT_FIELDS, [dev.number, ep, intf, alt, config])

    def open_device(self, dev: Any) -> Any:
        """Open a device."""
        return _Tracked(self._inner.open_device(dev.inner), dev.number)

    def close_device(self, dev_handle: Any) -> None:
        """Close a device."""
        self._inner.close_device(dev_handle.inner)

    def set_configuration(self, dev_handle: Any, config_value: int) -> None:
        """Set the configuration."""
        self._inner.set_configuration(dev_handle.inner, config_value)

    def get_configuration(self, dev_handle: Any) -> Any:
        """Return the configuration."""
        return self._inner.get_configuration(dev_handle.inner)

    def claim_interface(self, dev_handle: Any, intf: int) -> None:
        """Claim an interface."""
        self._inner.claim_interface(dev_handle.inner, intf)

    def release_interface(self, dev_handle: Any, intf: int) -> None:
        """Release an interface."""
        self._inner.release_interface(dev_handle.inner, intf)

    def clear_halt(self, dev_handle: Any, ep: int) -> None:
        """Clear a stall."""
        self._inner.clear_halt(dev_handle.inner, ep)

    def ctrl_transfer(  # noqa: PLR0917 - pyusb's signature
        self,
        dev_handle: Any,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> Any:
        """Perform and write down a control transfer."""
        entry = {
            "kind": "control",
            "device": dev_handle.number,
            "setup": [bmRequestType, int(bRequest), wValue, int(wIndex), len(data)],
        }
        incoming = bool(bmRequestType & 0x80)
        if not incoming:
            entry["out"] = data.tobytes().hex()
        try:
            count = self._inner.ctrl_transfer(
                dev_handle.inner, bmRequestType, bRequest, wValue, wIndex, data, timeout
            )
        except usb.core.USBError as error:
            self._write(entry | {"error": _describe(error)})
            raise
        entry["count"] = count
        if incoming:
            entry["in"] = data[:count].tobytes().hex()
        self._write(entry)
        return count

    def bulk_read(self, dev_handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> Any:
        """Perform and write down a bulk read."""
        entry = {
            "kind": "bulk_in",
            "device": dev_handle.number,
            "setup": [ep, len(buff) * buff.itemsize],
        }
        try:
            count = self._inner.bulk_read(dev_handle.inner, ep, intf, buff, timeout)
        except usb.core.USBError as error:
            self._write(entry | {"error": _describe(error)})
            raise
        received = memoryview(buff)[:count]
        entry |= {"count": count, "sha256": hashlib.sha256(received).hexdigest()}
        if self._keep_data:
            entry["in"] = base64.b64encode(received).decode()
        self._write(entry)
        return count

    def bulk_write(self, dev_handle: Any, ep: int, intf: int, data: Any, timeout: int) -> Any:
        """Perform and write down a bulk write."""
        entry = {
            "kind": "bulk_out",
            "device": dev_handle.number,
            "setup": [ep, len(data) * data.itemsize],
            "out": data.tobytes().hex(),
        }
        try:
            entry["count"] = self._inner.bulk_write(dev_handle.inner, ep, intf, data, timeout)
        except usb.core.USBError as error:
            self._write(entry | {"error": _describe(error)})
            raise
        self._write(entry)
        return entry["count"]

    def _note(self, descriptor: Any, fields: tuple[str, ...], key: list[int]) -> Any:
        kind = {1: "device", 2: "configuration", 4: "interface", 5: "endpoint"}[len(key)]
        noted = f"{kind} {key}"
        if noted not in self._noted:
            self._noted.add(noted)
            values = {name: _plain(getattr(descriptor, name)) for name in fields}
            self._write({"kind": kind, "key": key, "fields": values})
        return descriptor

    def _write(self, entry: dict[str, Any]) -> None:
        with self._lock:
            if self._file is None:
                self._file = self.path.open("a", encoding="utf-8")
            stamped = {"t_s": round(time.monotonic() - self._started_s, 6)} | entry
            self._file.write(json.dumps(stamped) + "\n")


def _free_name(path: Path) -> Path:
    candidate, number = path, 0
    while candidate.exists():
        number += 1
        candidate = path.with_stem(f"{path.stem}-{number}")
    return candidate


def _plain(value: Any) -> Any:
    """Return a descriptor's value as JSON can hold it."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, (bytes, list, tuple)) or hasattr(value, "__len__"):
        return [int(part) for part in value]
    return int(value)


def _describe(error: Any) -> dict[str, Any]:
    return {
        "code": error.backend_error_code,
        "errno": error.errno,
        "text": error.strerror,
        "timeout": isinstance(error, usb.core.USBTimeoutError),
    }
