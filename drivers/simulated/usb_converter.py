"""A simulated board's converter: pacing, results FIFO, faults."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

PACKET_SAMPLES = 256
_ENDPOINT_SAMPLES = 4 * PACKET_SAMPLES
_LONGEST_SLEEP_S = 0.02


class SourceClock(Protocol):
    """What the device needs of the rig's clock."""

    @property
    def speed(self) -> float:
        """Rig seconds per real second; infinite for as fast as the host reads."""

    def now_s(self) -> float:
        """Return rig time. [s]"""


class UsbFaults(Protocol):
    """Faults the device can be told to have."""

    unplug_usb_at_s: float | None
    usb_unplugged: bool
    stall_endpoint: bool
    overrun_at_sample: int | None
    short_read: bool
    drop_block_at_sample: int | None
    double_block_at_sample: int | None


class SignalSource(Protocol):
    """What is at the device's input: the simulated world, or a test source."""

    @property
    def clock(self) -> SourceClock:
        """The rig's clock."""

    @property
    def faults(self) -> UsbFaults:
        """The rig's faults."""

    def start_stream(
        self,
        sample_rate_hz: float,
        range_v: float,
        *,
        board_gain: float = 1.0,
        board_offset_v: float = 0.0,
    ) -> None:
        """Begin to convert; sample 0 is now; true volts = gain * raw volts + offset."""

    def stop_stream(self) -> None:
        """End the conversion."""

    def samples_due(self) -> int:
        """Return how many samples were converted so far."""

    def read_codes(self, start: int, count: int) -> NDArray[np.uint16]:
        """Return offset-binary codes of the raw volts."""


class _Jump(NamedTuple):
    """A place at which the stream leaves samples out, or hands some out again."""

    fault: str
    at: int
    """Sample of the converter."""
    shift: int
    """Left out; negative what comes once more."""


class SimulatedConverter:
    """Converts what the source shows and hands it out in packets.

    The depth of the results FIFO is ``None`` for endless. Behind an overrun a board goes on with a
    gap, or sends nothing more if it ``halts_at_overrun``. Packets
    left in the endpoint's buffers survive a stop, so a host that does not drain finds old samples
    at the head of its next run. That real boards do the same is INFERRED.
    """

    def __init__(
        self,
        source: SignalSource,
        fifo_samples: int | None = None,
        *,
        halts_at_overrun: bool = False,
    ) -> None:
        self._source = source
        self._halts_at_overrun = halts_at_overrun
        self._fifo_samples = fifo_samples
        self._lock = threading.RLock()
        self._running = False
        self.overrun = False
        self._rate_hz = 1.0
        self._next = 0
        self._left_over = np.empty(0, dtype=np.uint16)
        self.worst_backlog_samples = 0

    @property
    def running(self) -> bool:
        """Whether the pacer runs."""
        return self._running

    def start(
        self, rate_hz: float, range_v: float, *, board_gain: float, board_offset_v: float
    ) -> None:
        """Start the pacer at a nominal rate; true volts are gain * raw volts + offset."""
        with self._lock:
            self._rate_hz = rate_hz
            self._next = 0
            self.worst_backlog_samples = 0
            self._source.start_stream(
                rate_hz, range_v, board_gain=board_gain, board_offset_v=board_offset_v
            )
            self._running = True

    def stop(self) -> None:
        """Stop the pacer; a few packets stay in the endpoint's buffers."""
        with self._lock:
            if not self._running:
                return
            packets = min(self.due(), _ENDPOINT_SAMPLES) // PACKET_SAMPLES
            self._left_over = self._fetch(packets * PACKET_SAMPLES)
            self._running = False
            self._source.stop_stream()

    def reset_results(self) -> None:
        """Empty the results FIFO and clear its overrun."""
        with self._lock:
            self.overrun = False
            if self._running:
                self._next += self.due()

    def read_into(
        self, out: NDArray[np.uint16], timeout_s: float, check: Callable[[], None]
    ) -> int:
        """Fill a host's buffer as a bulk read does and return the number of samples written.

        These are all, or the whole packets there were when time was up. ``check`` is called often;
        it raises when the device is gone or stalled.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            check()
            with self._lock:
                count = self._ready(out.size, late=time.monotonic() >= deadline_s)
                if count is not None:
                    self._hand_out(out[:count])
                    return count
                missing = out.size - (self.due() if self._running else 0)
                flow_hz = self._rate_hz * self._source.clock.speed if self._running else 0.0
            pause_s = missing / flow_hz if flow_hz else _LONGEST_SLEEP_S
            left_s = deadline_s - time.monotonic()
            time.sleep(max(0.0, min(pause_s, left_s, _LONGEST_SLEEP_S)))

    def _ready(self, wanted: int, *, late: bool) -> int | None:
        if self._left_over.size:
            return min(wanted, self._left_over.size)
        due = self.due() if self._running else 0
        jump = self._next_jump(wanted)
        # what is lost was converted, too
        ready = due - (jump.shift if jump is not None and jump.shift > 0 else 0)
        if ready < wanted:
            packets = max(0, ready // PACKET_SAMPLES)
            return min(wanted, packets * PACKET_SAMPLES) if late else None
        if math.isfinite(self._source.clock.speed):
            self.worst_backlog_samples = max(self.worst_backlog_samples, due)
        if self._fifo_samples is not None and due > self._fifo_samples:
            self.overrun = True
            self._next += due - self._fifo_samples
        # A short packet ends a transfer early; the rest comes with the next one.
        return wanted // 2 if self._source.faults.short_read and wanted > 1 else wanted

    def _hand_out(self, out: NDArray[np.uint16]) -> None:
        if self._left_over.size:
            out[:] = self._left_over[: out.size]
            self._left_over = self._left_over[out.size :]
            return
        if out.size:  # a drain after the stop asks a source that stands for nothing
            out[:] = self._fetch(out.size)

    def due(self) -> int:
        """Return how many converted samples wait for the host."""
        with self._lock:
            if self.overrun and self._halts_at_overrun:
                return 0
            return max(0, self._source.samples_due() - self._next)

    def _fetch(self, count: int) -> NDArray[np.uint16]:
        jump = self._next_jump(count)
        if jump is None:
            codes = self._source.read_codes(self._next, count)
            self._next += count
        else:
            setattr(self._source.faults, jump.fault, None)
            self.overrun = self.overrun or jump.fault == "overrun_at_sample"
            head = jump.at - self._next
            after = jump.at + jump.shift
            codes = np.concatenate(
                [
                    self._source.read_codes(self._next, head),
                    self._source.read_codes(after, count - head),
                ]
            )
            self._next = after + count - head
        return codes

    def _next_jump(self, count: int) -> _Jump | None:
        """Return where the stream jumps inside the next samples; each once."""
        for fault, shift in (
            ("overrun_at_sample", PACKET_SAMPLES),
            ("drop_block_at_sample", PACKET_SAMPLES),
            ("double_block_at_sample", -PACKET_SAMPLES),
        ):
            at = getattr(self._source.faults, fault)
            if at is not None and at < self._next + count and count:
                at = max(at, self._next)
                return _Jump(fault, at, max(shift, -at))
        return None
