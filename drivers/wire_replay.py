"""A USB backend that replays a captured log and fails on any deviation.

For the first real board: capture once with `drivers.wire_log`, then run the driver against the
log wherever there is no board, and see at once when a change of the driver changes the wire.
"""

from __future__ import annotations

import base64
import json
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import usb.backend
import usb.core

from drivers.wire_log import FORMAT

_DESCRIPTORS = ("device", "configuration", "interface", "endpoint")
_TRANSFERS = ("control", "bulk_in", "bulk_out")


class WireLogError(Exception):
    """The driver did something else than the log says, or the log cannot be played."""


class ReplayBackend(usb.backend.IBackend):  # type: ignore[misc] # pyusb has no types
    """Answers from a log that was captured with its data, transfer by transfer.

    A WireLogError says that the file is no such log. Control and bulk transfers must come in the
    order of the log with the same parameters and data. What is on the bus changes where it changed
    in the log. Time is not replayed.
    """

    def __init__(self, path: Path) -> None:
        self._lock = threading.Lock()
        self._descriptors: dict[tuple[str, tuple[int, ...]], SimpleNamespace] = {}
        self._bus: list[tuple[int, list[int]]] = []
        self._bus_at = -1
        self._transfers: list[dict[str, Any]] = []
        self._next = 0
        self._read(path)

    def finish(self) -> None:
        """Check that the whole log was used; WireLogError if transfers are left over."""
        left = len(self._transfers) - self._next
        if left:
            raise WireLogError(
                f"{left} of {len(self._transfers)} transfers were not replayed; "
                f"the next is {_short(self._transfers[self._next])}."
            )

    def enumerate_devices(self) -> Any:
        """Return what the log has on the bus at this point."""
        following = self._bus_at + 1
        if following < len(self._bus) and self._bus[following][0] <= self._next:
            self._bus_at = following
        return iter(self._bus[self._bus_at][1] if self._bus_at >= 0 else [])

    def get_device_descriptor(self, dev: int) -> Any:
        """Return a device's descriptor."""
        return self._descriptor("device", dev)

    def get_configuration_descriptor(self, dev: int, config: int) -> Any:
        """Return a configuration's descriptor."""
        return self._descriptor("configuration", dev, config)

    def get_interface_descriptor(self, dev: int, intf: int, alt: int, config: int) -> Any:
        """Return an interface's descriptor."""
        return self._descriptor("interface", dev, intf, alt, config)

    def get_endpoint_descriptor(self, dev: int, ep: int, intf: int, alt: int, config: int) -> Any:
        """Return an endpoint's descriptor."""
        return self._descriptor("endpoint", dev, ep, intf, alt, config)

    def open_device(self, dev: int) -> Any:
        """Return a handle, which is the device's number."""
        return dev

    def close_device(self, dev_handle: int) -> None:
        """Accept."""

    def set_configuration(self, dev_handle: int, config_value: int) -> None:
        """Accept."""

    def get_configuration(self, dev_handle: int) -> Any:
        """Return the device's first configuration."""
        return self._descriptor("configuration", dev_handle, 0).bConfigurationValue

    def claim_interface(self, dev_handle: int, intf: int) -> None:
        """Accept."""

    def release_interface(self, dev_handle: int, intf: int) -> None:
        """Accept."""

    def clear_halt(self, dev_handle: int, ep: int) -> None:
        """Accept."""

    def ctrl_transfer(  # noqa: PLR0917 - pyusb's signature
        self,
        dev_handle: int,
        bmRequestType: int,
        bRequest: int,
        wValue: int,
        wIndex: int,
        data: Any,
        timeout: int,
    ) -> Any:
        """Answer a control transfer."""
        done: dict[str, Any] = {
            "kind": "control",
            "device": dev_handle,
            "setup": [bmRequestType, int(bRequest), wValue, int(wIndex), len(data)],
        }
        incoming = bool(bmRequestType & 0x80)
        if not incoming:
            done["out"] = data.tobytes().hex()
        entry = self._expect(done)
        if incoming:
            _fill(data, bytes.fromhex(entry["in"]))
        return entry["count"]

    def bulk_read(self, dev_handle: int, ep: int, intf: int, buff: Any, timeout: int) -> Any:
        """Answer a bulk read."""
        size = len(buff) * buff.itemsize
        entry = self._expect({"kind": "bulk_in", "device": dev_handle, "setup": [ep, size]})
        _fill(buff, base64.b64decode(entry["in"]))
        return entry["count"]

    def bulk_write(self, dev_handle: int, ep: int, intf: int, data: Any, timeout: int) -> Any:
        """Accept a bulk write."""
        size = len(data) * data.itemsize
        out = data.tobytes().hex()
        done = {"kind": "bulk_out", "device": dev_handle, "setup": [ep, size], "out": out}
        return self._expect(done)["count"]

    def _read(self, path: Path) -> None:
        lines = path.read_text(encoding="utf-8").splitlines()
        if not lines:
            raise WireLogError(f"{path} is empty.")
        for number, line in enumerate(lines, start=1):
            try:
                entry = json.loads(line)
                kind = entry["kind"]
            except (ValueError, KeyError, TypeError) as error:
                raise WireLogError(f"{path}, line {number}: not an entry of a log.") from error
            if number == 1 and (kind != "log" or entry.get("format") != FORMAT):
                raise WireLogError(f"{path} is no {FORMAT} log.")
            if kind == "bus":
                self._bus.append((len(self._transfers), entry["devices"]))
            elif kind in _DESCRIPTORS:
                key = (kind, tuple(entry["key"]))
                self._descriptors[key] = SimpleNamespace(**entry["fields"])
            elif kind in _TRANSFERS:
                self._transfers.append(entry | {"line": number})
            if kind == "bulk_in" and "in" not in entry and "error" not in entry:
                raise WireLogError(
                    f"{path}, line {number}: captured without data, which a replay needs."
                )

    def _descriptor(self, kind: str, *key: int) -> Any:
        try:
            return self._descriptors[kind, key]
        except KeyError:
            # pyusb's word for "past the end" when it iterates.
            raise IndexError(f"no {kind} descriptor {key} in the log") from None

    def _expect(self, done: dict[str, Any]) -> dict[str, Any]:
        with self._lock:
            if self._next >= len(self._transfers):
                raise WireLogError(f"The log has ended, and the driver went on: {_short(done)}.")
            entry = self._transfers[self._next]
            if any(entry.get(name) != value for name, value in done.items()):
                raise WireLogError(
                    f"Line {entry['line']} of the log says {_short(entry)}, "
                    f"the driver did {_short(done)}."
                )
            self._next += 1
        error = entry.get("error")
        if error is not None:
            kind = usb.core.USBTimeoutError if error["timeout"] else usb.core.USBError
            raise kind(error["text"], error["code"], error["errno"])
        return entry


def _fill(buffer: Any, data: bytes) -> None:
    memoryview(buffer).cast("B")[: len(data)] = data


def _short(entry: dict[str, Any]) -> str:
    setup = " ".join(f"{number:#x}" for number in entry["setup"])
    out = f" out {entry['out'][:32]}" if entry.get("out") else ""
    return f"{entry['kind']} to device {entry['device']} [{setup}]{out}"
