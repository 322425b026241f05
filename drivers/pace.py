"""A proof that every sample arrived: the count against the clock, and blocks compared.

A status word tells of an overrun. A packet that the bus or a driver loses or hands over twice tells
nothing, and no counter of samples is known of the board. It shows only in this:

- No sample arrives before it was converted, and none was converted before the command that started
  the converter was sent. Behind a lost packet every transfer is later than that by the packet's
  length, for ever. One single transfer that is less late proves that nothing was lost before it,
  however busy the host is; if none comes in time, the record is refused.
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
PATIENCE_S = 0.5
"""So long a record waits for one transfer that proves it whole. [s]"""
CATCH_UP_S = 5.0
"""So long at most where the host lags behind and catches up meanwhile. [s]"""
BEGINNING_SAMPLES = 40_000
"""Arrivals so near the start tell the board's latency; later ones carry the rate's error. [1]"""
_RATE_SIGMAS = 5.0
# A start command that took longer than this, and than usual, was interrupted somewhere: the sooner
# of its two ends is then too soon, and a whole record could not be told from one with a gap.
_SHARP_START_S = 6e-5
_USUAL_STARTS = 2.0
# A board whose own latency takes up the better part of a packet can prove nothing by the bound:
# what is usual for it takes its place, and half a packet. A few runs tell it from a busy moment.
_SHORT_LATENCY = 0.75
_LEARNING_RUNS = 3


@dataclass
class Latency:
    """The usual delays of one opened board."""

    shortest_s: float = float("inf")
    """The least that ever passed from the start command to a first sample on the host, that
    sample's age taken off."""
    start_s: float = float("inf")
    """The shortest start command. [s]"""
    runs: int = 0
    """Number of runs it was learned from."""


class Pace:
    """Compares the count of one run's samples with the host's clock.

    ``latency`` is shared by all runs of an opened board. ``late_s`` is by how much the last
    transfer came later than one can that follows no gap.
    """

    def __init__(
        self, sample_rate_hz: float, sample_rate_u_hz: float, latency: Latency | None = None
    ) -> None:
        self._usual = latency or Latency()
        self._rate_hz = sample_rate_hz
        self._packet_s = PACKET_SAMPLES / sample_rate_hz
        self._drift = _RATE_SIGMAS * sample_rate_u_hz / sample_rate_hz
        self._start_s: float | None = None
        self._began_s: float | None = None
        self._floor_s = float("inf")
        self._doubt_s = float("inf")
        self._lasted_s = 0.0
        self.late_s = 0.0

    @property
    def late_samples(self) -> int:
        """By how many samples the last transfer was late. [1]"""
        return round(self.late_s * self._rate_hz)

    @property
    def provable_s(self) -> float:
        """The longest run that can be proved whole; later the rate's error may be a packet's."""
        return self._packet_s / self._drift if self._drift else float("inf")

    @property
    def lasted_s(self) -> float:
        """From the run's start to its last transfer. [s]"""
        return self._lasted_s

    @property
    def on_time(self) -> bool:
        """Whether the last transfer proves that nothing was lost before it."""
        return self._doubt_s < 0.0

    def started(self, before_s: float, after_s: float) -> bool:
        """Note between which times on the monotonic clock the converter was started.

        ``False`` means that the command took so long that another start is worth its while.
        """
        took_s = after_s - before_s
        usual_s = max(_SHARP_START_S, _USUAL_STARTS * self._usual.start_s)
        self._usual.start_s = min(self._usual.start_s, took_s)
        self._usual.runs += 1
        self._start_s = before_s
        return took_s <= usual_s

    def arrived(self, samples: int, now_s: float) -> None:
        """Note a transfer that arrived at ``now_s`` on the monotonic clock.

        ``samples`` were received since the run began, those of this transfer included.
        """
        if self._began_s is None:
            self._began_s = now_s if self._start_s is None else self._start_s
        delay_s = now_s - samples / self._rate_hz
        self._lasted_s = now_s - self._began_s
        allowed_s = self._drift * self._lasted_s
        if self._start_s is None:
            # Nobody knows when it began: the run's own earliest arrival must do.
            self._floor_s = min(self._floor_s, delay_s)
            self.late_s = delay_s - self._floor_s - allowed_s
            self._doubt_s = self.late_s - self._packet_s / 2
            return
        since_s = delay_s - self._start_s
        if samples <= BEGINNING_SAMPLES:
            self._usual.shortest_s = min(self._usual.shortest_s, since_s)
        usual = self._usual
        # what was learned while the host was busy is too long: the run's own arrivals count as well
        self._floor_s = min(self._floor_s, since_s + allowed_s)
        self.late_s = since_s - min(usual.shortest_s, self._floor_s, since_s)
        if usual.runs > _LEARNING_RUNS and usual.shortest_s > _SHORT_LATENCY * self._packet_s:
            self._doubt_s = self.late_s - allowed_s - self._packet_s / 2
        else:
            self._doubt_s = since_s + allowed_s - self._packet_s


def check_pace(pace: Pace, record: Record) -> None:
    """Refuse a record that no transfer proved whole: an OverrunError carries it as evidence."""
    if pace.on_time:
        return
    if pace.lasted_s > pace.provable_s:
        raise OverrunError(
            f"Nothing can prove that this record is whole: it ended {pace.lasted_s:.2f} s after "
            f"the start of the converter, and only {pace.provable_s:.2f} s can be proved.",
            why="By then the error that sample_rate_u_hz allows the clock is as long as a lost "
            f"packet of {PACKET_SAMPLES} samples.",
            remedy="Measure the sample rate against a counter and write the smaller "
            "sample_rate_u_hz into the configuration, or let the sphere fall sooner after arming.",
            record=record,
        )
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

    An OverrunError with the place of the first repetition carries it as evidence.
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
    """Return the first sample of a block that repeats the one before it bit for bit.

    A block of one single code does not count: a clipped or silent input looks like that by nature.
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
