"""The settings that every streaming board has: which one, which input, its rate, its buffers."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import ConfigurationError

_PACKET_BYTES = 512
_LARGEST_RATE_DEVIATION = 0.05
_BYTES_PER_SAMPLE = 2


@dataclass(frozen=True, kw_only=True)
class StreamSettings(ABC):
    """What a board adds: its ids, its ranges, and ``pacer_divisor``.

    A ConfigurationError says that they cannot describe a real board.
    """

    sample_rate_hz: float
    sample_rate_u_hz: float
    """Standard uncertainty of ``sample_rate_hz``, the calibrated rate; the nominal rate is not
    it."""
    serial_number: str | None = None
    """Chooses among several boards."""
    fpga_file: Path | None = None
    """The user's bit stream for an unloaded board."""
    channel: int = 0
    range_v: float = 10.0
    """Half the range, which is +/- this."""
    ring_seconds: float = 2.0
    """More than a record."""
    transfer_bytes: int = 16384
    """Size of one read, a multiple of 512. A read ends when it is full, so a stop takes up to one
    of them: 8 ms at 1 MS/s and 16384 bytes. [B]"""
    pace_checked: bool = True
    """Whether the count of samples is compared with the host's clock, which shows lost blocks. Off
    only where the transport does not run in real time: an accelerated simulation, a replay."""
    wire_log_file: Path | None = None
    """Where to write every transfer, for the first run with a new board. Samples are then not
    compared with the clock, because a replay does not keep the time of the recording."""
    wire_log_data: bool = False
    """Whether that log holds the samples too, which a replay needs."""

    def __post_init__(self) -> None:
        self._check_rate()
        if self.transfer_bytes <= 0 or self.transfer_bytes % _PACKET_BYTES:
            raise ConfigurationError(
                f"A transfer of {self.transfer_bytes} bytes is no multiple of {_PACKET_BYTES}.",
                why="A USB 2.0 bulk packet has 512 bytes; a shorter read would overflow.",
                remedy="Set transfer_bytes to 16384.",
            )
        if not math.isfinite(self.ring_seconds) or (
            self.ring_samples < 2 * self.transfer_bytes // _BYTES_PER_SAMPLE
        ):
            raise ConfigurationError(
                f"A ring of {self.ring_seconds} s is shorter than two transfers.",
                remedy="Set ring_seconds to 2.0.",
            )

    @property
    @abstractmethod
    def nominal_rate_hz(self) -> float:
        """The rate that the pacer's divisor asks for."""

    @property
    def ring_samples(self) -> int:
        """Capacity of the ring buffer. [1]"""
        return round(self.ring_seconds * self.sample_rate_hz)

    def _check_rate(self) -> None:
        nominal_hz = self.nominal_rate_hz
        rate_hz, u_hz = self.sample_rate_hz, self.sample_rate_u_hz
        if not (math.isfinite(rate_hz) and rate_hz > 0 and math.isfinite(u_hz) and u_hz >= 0):
            raise ConfigurationError(
                f"A sample rate of {rate_hz} Hz with u = {u_hz} Hz cannot be.",
                remedy="Measure it against a counter and set sample_rate_hz, sample_rate_u_hz.",
            )
        if abs(rate_hz / nominal_hz - 1.0) > _LARGEST_RATE_DEVIATION:
            raise ConfigurationError(
                f"The calibrated rate of {rate_hz:.0f} Hz is more than 5 % off the pacer's "
                f"{nominal_hz:.0f} Hz.",
                why="sample_rate_hz and pacer_divisor describe different rates.",
                remedy="Correct the one that is wrong.",
            )
