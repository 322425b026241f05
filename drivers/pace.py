"""Whether every sample arrived: the count against the clock, and blocks against themselves.

A status word tells of an overrun. A packet that the bus or a driver loses or hands over twice tells
nothing; it shows only in this:

- A transfer cannot arrive before its last sample was converted, and on a host that is not busy it
  arrives soon after. The earliest arrival so far, counted from the stream's beginning, is the
  floor. Behind a lost packet every transfer is late by the packet's length, for ever; behind a busy
  moment the next ones are on time again.
- A packet handed over twice is equal to the one before it to the last bit, which noise of a few
  codes never is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import Record
from drivers.errors import OverrunError

PACKET_SAMPLES = 256
"""A USB 2.0 bulk packet has 512 bytes: the least that can get lost. [1]"""
PATIENCE_S = 0.2
"""So long a record waits for one transfer that arrives on time. [s]"""
_RATE_SIGMAS = 5.0
# The start of a stream is known well enough only if its command was over within a quarter of a
# packet at 1 MS/s; on a real bus it rarely is, and then the run's own earliest arrival must do.
_SHARP_START_S = 6e-5
_FIRST_SAMPLES = 4096


@dataclass
class Latency:
    """The shortest time from a sample to the host that one opened board has ever shown.

    Attributes
    ----------
    shortest_s : float
        Over all runs whose start was sharp. [s]
    """

    shortest_s: float = float("inf")


class Pace:
    """Holds the count of one run's samples against the host's clock.

    Parameters
    ----------
    sample_rate_hz, sample_rate_u_hz : float
        Calibrated rate and its standard uncertainty. [Hz]
    latency : Latency, optional
        Shared by all runs: on a host that is busy for a whole run no arrival is early, and the
        floor of other runs shows it.
    """

    def __init__(
        self, sample_rate_hz: float, sample_rate_u_hz: float, latency: Latency | None = None
    ) -> None:
        self._latency = latency or Latency()
        self._start_s: float | None = None
        self._rate_hz = sample_rate_hz
        self._drift = _RATE_SIGMAS * sample_rate_u_hz / sample_rate_hz
        self._began_s: float | None = None
        self._floor_s = float("inf")
        self.late_s = 0.0

    @property
    def late_samples(self) -> int:
        """By how many samples the last transfer was later than the earliest. [1]"""
        return round(self.late_s * self._rate_hz)

    @property
    def on_time(self) -> bool:
        """Whether the last transfer was late by less than half a packet."""
        return self.late_s * self._rate_hz < PACKET_SAMPLES / 2

    def started(self, before_s: float, after_s: float) -> None:
        """Note between which moments the converter was started.

        Parameters
        ----------
        before_s, after_s : float
            Around the command that starts it, on the monotonic clock. [s]
        """
        if after_s - before_s <= _SHARP_START_S:
            self._start_s = before_s

    def arrived(self, samples: int, now_s: float) -> None:
        """Note a transfer.

        Parameters
        ----------
        samples : int
            Samples received since the run began, this transfer included. [1]
        now_s : float
            When it arrived, on the monotonic clock. [s]
        """
        if self._began_s is None:
            self._began_s = now_s
        delay_s = now_s - samples / self._rate_hz
        self._floor_s = min(self._floor_s, delay_s)
        if self._start_s is not None:
            # A duplicate would make arrivals early; what is found twice is refused elsewhere.
            known = self._latency
            if samples <= _FIRST_SAMPLES:  # later ones would carry an error of the rate along
                known.shortest_s = min(known.shortest_s, self._floor_s - self._start_s)
            self._floor_s = min(self._floor_s, self._start_s + known.shortest_s)
        allowed_s = self._drift * (now_s - self._began_s)
        self.late_s = delay_s - self._floor_s - allowed_s


def check_pace(pace: Pace, record: Record) -> None:
    """Refuse a record after which no transfer arrived on time again.

    Parameters
    ----------
    pace : Pace
        Of the run.
    record : Record
        The error carries it as evidence.

    Raises
    ------
    OverrunError
        If samples are missing.
    """
    if pace.on_time:
        return
    raise OverrunError(
        f"{pace.late_samples} samples fewer arrived than the clock says "
        f"({pace.late_s * 1e3:.2f} ms at {record.sample_rate_hz:.0f} Hz).",
        why="A block was lost without a word, sample_rate_hz is not this board's rate, or this "
        f"host was too busy for {PATIENCE_S:g} s.",
        remedy="Repeat the drop. If it happens again, measure sample_rate_hz against a counter and "
        "move other devices off this USB bus.",
        record=record,
    )


def check_repeats(record: Record, transfer_samples: int) -> None:
    """Refuse a record in which a packet or a transfer stands twice.

    Parameters
    ----------
    record : Record
        The error carries it as evidence.
    transfer_samples : int
        Length of one transfer. [1]

    Raises
    ------
    OverrunError
        With the place of the first repetition.
    """
    for length in sorted({PACKET_SAMPLES, transfer_samples}):
        at = repeated_at(record.codes, length)
        if at is not None:
            raise OverrunError(
                f"{length} samples from sample {at} on are those before them once more.",
                why="A block was handed over twice: everything behind it is shifted in time.",
                remedy="Repeat the drop. If it happens again, try another USB port and cable.",
                record=record,
            )


def repeated_at(codes: NDArray[np.int16], length: int) -> int | None:
    """Return where a block begins that repeats the one before it bit for bit.

    Parameters
    ----------
    codes : ndarray of int16, shape (n,)
        Samples of one record.
    length : int
        Of the block, > 0. [1]

    Returns
    -------
    int or None
        Its first sample. A block of one single code does not count: a clipped or silent input
        looks like that by nature.
    """
    if codes.size < 2 * length:
        return None
    same = codes[length:] == codes[:-length]
    ends = np.flatnonzero(~same)
    edges = np.concatenate(([-1], ends, [same.size]))
    for index in np.flatnonzero(np.diff(edges) > length):
        first = int(edges[index]) + 1
        block = codes[first : first + length]
        if block.min() != block.max():
            return first + length
    return None
