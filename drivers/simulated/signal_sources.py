"""Test signals for the simulated board's input, instead of a whole rig."""

from __future__ import annotations

import math
import threading

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.clock import RigClock
from drivers.simulated.faults import Faults

COUNT_PERIOD = 59999
"""A prime below the largest code: no block size divides it, and codes above it never occur."""

_ENDLESS = 1 << 62


class _PacedSource:
    """Counts the samples that are due; ``speed`` as of `drivers.simulated.clock.RigClock`."""

    def __init__(self, speed: float = 1.0) -> None:
        self.clock = RigClock(speed)
        self.faults = Faults()
        self.streams_started = 0
        self.streaming = False
        self._rate_hz = 0.0
        self._start_s = 0.0

    def start_stream(
        self,
        sample_rate_hz: float,
        range_v: float,
        *,
        board_gain: float = 1.0,
        board_offset_v: float = 0.0,
    ) -> None:
        """Begin to convert; sample 0 is now.

        Only the rate has a meaning here: these sources make codes, not volts.
        """
        self._begin()
        self._rate_hz = sample_rate_hz
        self._start_s = self.clock.now_s()
        self.streams_started += 1
        self.streaming = True

    def _begin(self) -> None:
        """Forget the last stream."""

    def stop_stream(self) -> None:
        """End the conversion."""
        self.streaming = False

    def samples_due(self) -> int:
        """Return how many samples were converted so far."""
        if not math.isfinite(self.clock.speed):
            return _ENDLESS
        return int((self.clock.now_s() - self._start_s) * self._rate_hz)


class CountingSource(_PacedSource):
    """Sample n has the code n modulo `COUNT_PERIOD`, which shows each loss."""

    def __init__(self, speed: float = 1.0) -> None:
        super().__init__(speed)
        self._ramp = (np.arange(8 * COUNT_PERIOD) % COUNT_PERIOD).astype(np.uint16)

    def read_codes(self, start: int, count: int) -> NDArray[np.uint16]:
        """Return the codes of samples ``[start, start + count)``."""
        phase = start % COUNT_PERIOD
        if phase + count <= self._ramp.size:
            return self._ramp[phase : phase + count]
        return (np.arange(start, start + count) % COUNT_PERIOD).astype(np.uint16)


class PulseSource(_PacedSource):
    """Noise around a baseline, and half-sine pulses on demand.

    ``speed`` is as of `drivers.simulated.clock.RigClock`; the idle input is offset binary.
    """

    WIDTH_SAMPLES = 100

    def __init__(
        self,
        speed: float = 1.0,
        *,
        seed: int = 1,
        noise_codes: float = 3.0,
        baseline_code: int = 32800,
    ) -> None:
        super().__init__(speed)
        noise = np.random.default_rng(seed).normal(baseline_code, noise_codes, 1 << 18)
        self._noise = np.rint(noise).astype(np.uint16)
        self._lock = threading.Lock()
        self._pulse: tuple[int, int] | None = None
        self._read_to = 0
        shape = np.sin(np.pi * np.arange(self.WIDTH_SAMPLES) / self.WIDTH_SAMPLES)
        self._shape = shape

    def _begin(self) -> None:
        with self._lock:
            self._read_to = 0
            self._pulse = None

    def fire(self, peak_codes: int = 8000, after_samples: int = 2000) -> int:
        """Append a pulse to the samples already read and return the position of its first sample.

        A negative height makes a falling pulse; the distance is from the newest sample.
        """
        with self._lock:
            at = max(self._read_to, 0) + after_samples
            self._pulse = (at, peak_codes)
            return at

    def read_codes(self, start: int, count: int) -> NDArray[np.uint16]:
        """Return the codes of samples ``[start, start + count)``."""
        codes = np.take(self._noise, np.arange(start, start + count), mode="wrap")
        with self._lock:
            self._read_to = max(self._read_to, start + count)
            pulse = self._pulse
        if pulse is not None:
            at, peak_codes = pulse
            first, last = max(at, start), min(at + self.WIDTH_SAMPLES, start + count)
            if first < last:
                part = self._shape[first - at : last - at] * peak_codes
                codes[first - start : last - start] += (
                    np.rint(part).astype(np.int64).astype(np.uint16)
                )
        return codes
