"""The interface of every vacuum valve, real or simulated.

Relay off = vacuum on = sphere held: the state a dead host leaves behind should be the safe one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@dataclass(frozen=True)
class ValveReport:
    """What a command did, as far as the board lets us know."""

    vacuum_on: bool
    """The state that was commanded."""
    confirmed: bool
    """Whether the board read back that state. LCUS-1 boards never can."""
    began_monotonic_ns: int
    """Host clock before the command's first byte: the valve did not move before. [ns]"""
    sent_monotonic_ns: int
    """Host clock when the command's last byte had been handed over; a busy host may look at its
    clock late. [ns]"""
    garbage: bytes = b""
    """Bytes that were tolerated and belong to no reply."""


@dataclass(frozen=True)
class VacuumReading:
    """The vacuum gauge."""

    code: int
    """Of the board's converter."""
    volts: float
    """``code`` times the calibrated volts per code."""
    held: bool
    """Whether a sphere closes the tube, by the calibrated threshold."""


@runtime_checkable
class Valve(Protocol):
    """A valve that holds a sphere by vacuum and lets it go."""

    @property
    def identity(self) -> str:
        """Return the board's own words about itself."""

    @property
    def can_confirm(self) -> bool:
        """Whether commands are read back."""

    def ensure_ready(self) -> None:
        """Open the port exclusively and put the valve in its safe state."""

    def hold(self) -> ValveReport:
        """Switch the vacuum on."""

    def release(self, permitted: Callable[[], bool] | None = None) -> ValveReport:
        """Break the vacuum: the sphere falls; AbortedError where it is not permitted any more."""

    def vacuum(self) -> VacuumReading | None:
        """Return the gauge, ``None`` where the board has none."""

    def ensure_safe(self) -> None:
        """Vacuum on by whatever still works; safe to call at any time, from any thread."""

    def close(self) -> None:
        """Make safe, then give the port back."""
