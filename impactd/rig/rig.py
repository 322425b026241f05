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

from drivers.digitizer import Digitizer
from drivers.valve import Valve

if TYPE_CHECKING:
    from drivers.simulated.world import World


class Loader(Protocol):
    """A person or a program that hangs the sphere."""

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
        """The present request."""
        with self._lock:
            return self._asked

    def ask(self, sphere: str, surface: str, drop_height_m: float) -> str:
        """Return the request in words: what to hang where, the sphere's lowest point how high."""
        words = in_words(sphere, surface, drop_height_m)
        with self._lock:
            self._asked = words
        return words

    def cancel(self) -> None:
        """Take the request back."""
        with self._lock:
            self._asked = None


def in_words(sphere: str, surface: str, drop_height_m: float) -> str:
    """Return what to hang where, as an imperative without a full stop.

    The height is that of the sphere's lowest point above the coupon.
    """
    return f"hang the {sphere} sphere {drop_height_m * 1e3:.1f} mm above the {surface} coupon"


@dataclass
class Rig:
    """Everything a drop needs."""

    digitizer: Digitizer
    """Real driver, whatever the transport; so is the valve's."""
    valve: Valve
    loader: Loader
    """Person or simulated technician."""
    name: str
    """Written into every shot."""
    simulated: bool
    """Whether the transports are simulated."""
    clock_speed: float = 1.0
    """Rig seconds per host second; 1 on a real rig, inf where the rig waits for the host. [1]"""
    world: World | None = None
    """The simulated world, for tests and demonstrations."""
    closing: list[Callable[[], None]] = field(default_factory=list)
    """What else ends with the rig."""

    def close(self) -> None:
        """Stop the digitizer, make the valve safe, close both; safe to call twice.

        Raises DriverError, the last one, after everything was tried.
        """
        with ExitStack() as stack:  # runs all of them, last one first
            while self.closing:
                stack.callback(self.closing.pop(0))
            stack.callback(self.valve.close)
            stack.callback(self.digitizer.close)
