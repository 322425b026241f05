"""The interface of every digitizer, real or simulated."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class DigitizerIdentity:
    """Which board answered, and with which images."""

    model: str
    serial_number: str
    firmware_version: str
    firmware_sha256: str | None
    """Hash of the image this process loaded, ``None`` when the board was already loaded."""
    fpga_sha256: str | None
    """The same of the FPGA's image."""
    note: str
    """What a user must know about it, e.g. ``"untested on a 3500"``."""


@dataclass(frozen=True)
class TriggerSettings:
    """When a record begins and how long it is."""

    level_v: float
    """The signal must reach this level above the baseline (sign gives the slope). [V]"""
    hysteresis_v: float
    """It must have been below ``level_v - hysteresis_v`` before. [V]"""
    pre_trigger_samples: int
    """Samples kept before the trigger. [1]"""
    record_samples: int
    """Of the whole record."""


@dataclass(frozen=True)
class Record:
    """One digitised impact, whole or not at all."""

    codes: NDArray[np.int16]
    """Raw converter codes (offset binary minus 32768), never corrected. Shape (n,)."""
    volts_per_code: float
    offset_v: float
    """``volts = codes * volts_per_code + offset_v``, calibration included."""
    calibrated: bool
    """Whether the board's own calibration table was valid and is in the two numbers above."""
    sample_rate_hz: float
    """Calibrated."""
    sample_rate_u_hz: float
    """Its standard uncertainty."""
    range_v: float
    """Half the converter's range, which is +/- this."""
    trigger_index: int
    """Sample at which the trigger condition was met. [1]"""
    first_sample_index: int
    """Position of ``codes[0]`` in the stream since it was started. [1]"""
    trigger_monotonic_ns: int
    """Host clock when the trigger was recognised. [ns]"""
    status_words: tuple[int, ...] = field(default=())
    """Acquisition status at start and end."""
    samples_streamed: int = 0
    """Samples received since the stream began; a whole number of transfers. [1]"""


@runtime_checkable
class Digitizer(Protocol):
    """A digitizer that streams into memory and triggers in software."""

    @property
    def identity(self) -> DigitizerIdentity:
        """Return who the board is; valid after `ensure_ready`."""

    def ensure_ready(self) -> None:
        """Find, load, test and calibrate the board; do nothing when that was done."""

    def sample_baseline(self, samples: int) -> NDArray[np.float64]:
        """Return so many samples of the idle input. [V]"""

    def arm(self, trigger: TriggerSettings) -> None:
        """Start streaming and return once the pre-trigger part is filled."""

    def wait_record(self, timeout_s: float, abort: threading.Event) -> Record:
        """Return the record, or raise TriggerTimeoutError, OverrunError or AbortedError."""

    def wait_trigger(self, timeout_s: float, abort: threading.Event) -> int:
        """Return the host clock at the trigger, before the record is full. [ns]"""

    def ensure_stopped(self) -> None:
        """Stop and drain; safe to call at any time, in any state, from any thread."""

    def close(self) -> None:
        """Stop and give the board back."""
