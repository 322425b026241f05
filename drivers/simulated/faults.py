"""Faults on demand; the simulated transports check them before they answer."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass
class Faults:
    """Switches a test or a demonstration may set at any moment from any thread.

    Every field is one plain value, so a single assignment is atomic.

    Attributes
    ----------
    unplug_usb_at_s : float or None
        Rig time at which the digitizer disappears. [s]
    usb_unplugged : bool
        The digitizer is not there.
    stall_endpoint : bool
        The bulk endpoint answers with a stall.
    overrun_at_sample : int or None
        Stream position at which the device drops a block and reports an overrun. [1]
    short_read : bool
        Transfers return fewer bytes than asked.
    drop_block_at_sample, double_block_at_sample : int or None
        Stream position at which a block is lost or sent twice without a word. [1]
    serial_garbage : bytes
        Sent before every reply of the relay board.
    serial_silent : bool
        The relay board takes commands and does not answer.
    serial_cut : bool
        The relay board's port disappears.
    relay_stuck : bool
        The relay no longer follows commands; reading it back shows the truth.
    no_sphere : bool
        Nobody hangs a sphere: loading does nothing.
    """

    unplug_usb_at_s: float | None = None
    usb_unplugged: bool = False
    stall_endpoint: bool = False
    overrun_at_sample: int | None = None
    short_read: bool = False
    drop_block_at_sample: int | None = None
    double_block_at_sample: int | None = None
    serial_garbage: bytes = b""
    serial_silent: bool = False
    serial_cut: bool = False
    relay_stuck: bool = False
    no_sphere: bool = False

    def clear(self) -> None:
        """Heal everything that can be healed (a cut port stays cut)."""
        for field in fields(self):
            setattr(self, field.name, field.default)
