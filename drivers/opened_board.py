"""What opening a board yields: its link, its identity, and how its codes become volts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from drivers.digitizer import DigitizerIdentity
from drivers.usb_link import UsbLink

LinkT = TypeVar("LinkT", bound=UsbLink)


@dataclass(frozen=True)
class RangeCalibration:
    """How codes of one range become volts."""

    volts_per_code: float
    """``volts = signed_code * volts_per_code + offset_v``. [V]"""
    offset_v: float
    calibrated: bool
    """Whether the board's table is in the two numbers."""
    reason: str = ""
    """Why it is not."""


@dataclass(frozen=True)
class OpenedBoard(Generic[LinkT]):
    """A board that answered, was loaded and tested."""

    link: LinkT
    identity: DigitizerIdentity
    calibration: RangeCalibration
