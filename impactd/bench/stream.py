"""The 1 MS/s path, counted sample by sample: simulated transport, pyusb, driver, ring, trigger."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.daq3500.device import Daq3500
from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import TriggerSettings
from drivers.errors import TriggerTimeoutError
from drivers.ring_buffer import RingBuffer
from drivers.simulated.signal_sources import COUNT_PERIOD, CountingSource
from drivers.simulated.usb_device import SimulatedDaq3500
from drivers.simulated.usb_eeprom import PERFECT
from impactd.bench.figure import Figure

NOMINAL_RATE_HZ = 1.0e6
RATIO_GOAL = 20.0
FLAT_OUT_S = 3.0
REAL_TIME_S = 60.0
_NEVER = TriggerSettings(
    level_v=15.5, hysteresis_v=1.0, pre_trigger_samples=20_000, record_samples=400_000
)


@dataclass
class SampleCounter:
    """Checks each sample of a counting source as it lies in the ring.

    Attributes
    ----------
    samples, lost, doubled, wrong : int
        Seen; missing; sent twice; in blocks that are no count at all. [1]
    """

    samples: int = 0
    lost: int = 0
    doubled: int = 0
    wrong: int = 0
    _shift: int = 0
    _ramp: NDArray[np.uint16] = field(
        default_factory=lambda: (np.arange(4 * COUNT_PERIOD) % COUNT_PERIOD).astype(np.uint16)
    )

    def look(self, ring: RingBuffer, first: int, count: int) -> None:
        """Check one block.

        Parameters
        ----------
        first : int
            Its position in the stream; a new stream begins at 0. [1]
        count : int
            Its length. [1]
        """
        if first == 0:
            self._shift = 0
        codes = ring.copy(first, count)
        self.samples += count
        at = 0
        while at < count:
            # Count whole stretches: compare with the ramp, then resume behind a jump.
            phase = (first + at + self._shift) % COUNT_PERIOD
            part = codes[at : at + self._ramp.size - phase]
            equal = part == self._ramp[phase : phase + part.size]
            if equal.all():
                at += part.size
                continue
            at += int(np.argmin(equal))
            self._jump(int(codes[at]), first + at)

    def _jump(self, code: int, position: int) -> None:
        half = COUNT_PERIOD // 2
        jump = (code - position - self._shift + half) % COUNT_PERIOD - half
        if code >= COUNT_PERIOD:
            self.wrong += 1
            return
        self._shift += jump
        if jump > 0:
            self.lost += jump
        else:
            self.doubled -= jump


class _TimedBoard(SimulatedDaq3500):
    """Knows how much of the reading thread's time the simulation itself takes."""

    def __init__(self, source: CountingSource) -> None:
        super().__init__(source, errors=PERFECT)
        self.reads = 0
        self.busy_s = 0.0

    def bulk_read(self, dev_handle: Any, ep: int, intf: int, buff: Any, timeout: int) -> int:
        """Return samples as they are due."""
        before_s = time.thread_time()
        try:
            return super().bulk_read(dev_handle, ep, intf, buff, timeout)
        finally:
            self.reads += 1
            self.busy_s += time.thread_time() - before_s


def measure_stream(seconds: float, flat_out: bool) -> dict[str, Any]:
    """Stream for so long through the real driver and count every sample.

    Parameters
    ----------
    seconds : float
        How long. [s]
    flat_out : bool
        Whether samples are due as fast as they are read, instead of 1 million a second.

    Returns
    -------
    dict
        JSON-ready: ``samples``, ``lost``, ``doubled``, ``wrong``, ``seconds``,
        ``samples_per_s``, ``ratio_to_1_msps``, ``cpu_share`` (of one core, the whole process),
        ``driver_cpu_share`` (without the simulated board), ``worst_backlog_samples`` (longest
        gap between reads, real time only), ``reads``, ``transfer_bytes``.
    """
    counter = SampleCounter()
    board = _TimedBoard(CountingSource(math.inf if flat_out else 1.0))
    settings = Daq3500Settings(
        vendor_id=0x0622,
        product_id_unloaded=0x0470,
        product_id_loaded=0x2C01,
        sample_rate_hz=NOMINAL_RATE_HZ,
        sample_rate_u_hz=0.0,
    )
    digitizer = Daq3500(settings, backend=board, observe=counter.look)
    try:
        digitizer.ensure_ready()
        before = (counter.samples, board.reads, board.busy_s)
        start_s, start_cpu_s = time.perf_counter(), time.process_time()
        digitizer.arm(_NEVER)
        # The count never reaches the trigger level, so the time-out is the end of the run.
        with contextlib.suppress(TriggerTimeoutError):
            digitizer.wait_record(seconds, threading.Event())
        elapsed_s = time.perf_counter() - start_s
        cpu_s = time.process_time() - start_cpu_s
    finally:
        digitizer.close()
    samples = counter.samples - before[0]
    rate_hz = samples / elapsed_s
    return {
        "samples": samples,
        "lost": counter.lost,
        "doubled": counter.doubled,
        "wrong": counter.wrong,
        "seconds": elapsed_s,
        "samples_per_s": rate_hz,
        "ratio_to_1_msps": rate_hz / NOMINAL_RATE_HZ,
        "cpu_share": cpu_s / elapsed_s,
        "driver_cpu_share": (cpu_s - (board.busy_s - before[2])) / elapsed_s,
        "worst_backlog_samples": board.converter.worst_backlog_samples,
        "reads": board.reads - before[1],
        "transfer_bytes": settings.transfer_bytes,
    }


def measure() -> list[Figure]:
    """Run flat out for a moment, then a minute at 1 MS/s.

    Returns
    -------
    list of Figure
        Rate, lost or doubled samples, share of one core.
    """
    fast = measure_stream(FLAT_OUT_S, flat_out=True)
    steady = measure_stream(REAL_TIME_S, flat_out=False)
    miscounted = [float(run["lost"] + run["doubled"] + run["wrong"]) for run in (fast, steady)]
    return [
        Figure(
            name="stream flat out",
            value=fast["samples_per_s"],
            unit="S/s",
            reference=NOMINAL_RATE_HZ,
            reference_name="the converter",
            ratio=fast["ratio_to_1_msps"],
            goal=f">= {RATIO_GOAL:g}",
            met=fast["ratio_to_1_msps"] >= RATIO_GOAL and miscounted[0] == 0,
        ),
        Figure(
            name=f"lost or doubled of {steady['samples'] / 1e6:.1f} M samples at 1 MS/s",
            value=miscounted[1],
            unit="1",
            goal="0",
            met=miscounted[1] == 0,
        ),
        Figure(
            name="share of one core at 1 MS/s, driver",
            value=steady["driver_cpu_share"],
            unit="1",
            reference=steady["cpu_share"],
            reference_name="with the simulated board",
        ),
    ]
