"""Faults on demand; the simulated transports check them before they answer."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass
class Faults:
    """Switches a test or a demonstration may set at any moment from any thread.

    Every field is one plain value, so a single assignment is atomic.
    """

    unplug_usb_at_s: float | None = None
    """Rig time at which the digitizer disappears."""
    usb_unplugged: bool = False
    stall_endpoint: bool = False
    overrun_at_sample: int | None = None
    """Stream position at which the device drops a block and reports an overrun."""
    short_read: bool = False
    drop_block_at_sample: int | None = None
    """Stream position at which a block is lost without a report."""
    double_block_at_sample: int | None = None
    """Stream position at which a block is sent twice without a report."""
    serial_garbage: bytes = b""
    """Sent before every reply of the relay board."""
    serial_silent: bool = False
    """The relay board takes commands and does not answer."""
    serial_cut: bool = False
    relay_stuck: bool = False
    """The relay no longer follows commands; reading it back shows the truth."""
    no_sphere: bool = False
    """Loading does nothing."""

    def clear(self) -> None:
        """Clear every fault that can be cleared (a cut port stays cut)."""
        for field in fields(self):
            setattr(self, field.name, field.default)
