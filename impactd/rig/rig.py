"""The rig as the service sees it: a digitizer, a valve, and somebody who hangs spheres.

::

    settings ──> build_rig ──> Rig(digitizer, valve, loader)
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol

from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import Digitizer
from drivers.valve import Valve
from impactd.settings.settings import Settings

if TYPE_CHECKING:
    from drivers.simulated.world import World

_SETTLING_CODES = {1: 0, 5: 1, 10: 2, 1000: 3}


class Loader(Protocol):
    """Whoever hangs the sphere."""

    def ask(self, sphere: str, surface: str, drop_height_m: float) -> str:
        """Ask for a sphere; return the request in words, without waiting for it."""

    def cancel(self) -> None:
        """Take the request back; do nothing when there is none."""


class PersonLoader:
    """A person, who reads the request on the page, in the CLI or in the status."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: str | None = None

    @property
    def asked(self) -> str | None:
        """What is asked for at present."""
        with self._lock:
            return self._asked

    def ask(self, sphere: str, surface: str, drop_height_m: float) -> str:
        """Put the request into words.

        Parameters
        ----------
        drop_height_m : float
            Height of the sphere's lowest point above the coupon. [m]

        Returns
        -------
        str
            What to hang where.
        """
        words = in_words(sphere, surface, drop_height_m)
        with self._lock:
            self._asked = words
        return words

    def cancel(self) -> None:
        """Take the request back."""
        with self._lock:
            self._asked = None


def in_words(sphere: str, surface: str, drop_height_m: float) -> str:
    """Return what somebody is asked to hang where.

    Parameters
    ----------
    drop_height_m : float
        Height of the sphere's lowest point above the coupon. [m]

    Returns
    -------
    str
        An imperative without a full stop.
    """
    return f"hang the {sphere} sphere {drop_height_m * 1e3:.1f} mm above the {surface} coupon"


@dataclass
class Rig:
    """Everything a drop needs.

    Attributes
    ----------
    digitizer : Digitizer
        Real driver, whatever the transport.
    valve : Valve
        Real driver, whatever the transport.
    loader : Loader
        Person or simulated technician.
    name : str
        Written into every shot.
    simulated : bool
        Whether the transports are simulated.
    clock_speed : float
        Rig seconds per host second; 1 on a real rig, inf where the rig waits for the host. [1]
    world : World or None
        The simulated world, for tests and demonstrations.
    closing : list of callable
        What else ends with the rig.
    """

    digitizer: Digitizer
    valve: Valve
    loader: Loader
    name: str
    simulated: bool
    clock_speed: float = 1.0
    world: World | None = None
    closing: list[Callable[[], None]] = field(default_factory=list)

    def close(self) -> None:
        """Stop the digitizer, make the valve safe, give both back; safe to call twice.

        Raises
        ------
        DriverError
            The last of what went wrong, after everything was tried.
        """
        with ExitStack() as stack:  # runs all of them, last one first
            while self.closing:
                stack.callback(self.closing.pop(0))
            stack.callback(self.valve.close)
            stack.callback(self.digitizer.close)


def digitizer_settings(settings: Settings) -> Daq3500Settings:
    """Return the digitizer's part of the settings in the driver's words.

    Parameters
    ----------
    settings : Settings
        Checked whole.

    Returns
    -------
    Daq3500Settings
        Nothing in it is invented here.
    """
    section = settings.digitizer
    return Daq3500Settings(
        vendor_id=section.vendor_id,
        product_id_unloaded=section.product_id_unloaded,
        product_id_loaded=section.product_id_loaded,
        sample_rate_hz=section.sample_rate_hz,
        sample_rate_u_hz=section.sample_rate_u_hz,
        serial_number=section.serial_number,
        firmware_file=section.firmware_file,
        fpga_file=section.fpga_file,
        channel=section.channel,
        differential=section.differential,
        range_v=section.range_v,
        settling_code=_SETTLING_CODES[section.settling_us],
        pacer_divisor=section.pacer_divisor,
        ring_seconds=section.ring_seconds,
        transfer_bytes=section.transfer_bytes,
        wire_log_file=section.wire_log_file,
    )
