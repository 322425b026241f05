"""From a stream of blocks to the samples of one record: fill, arm, trigger, complete.

Nothing here depends on a board: it works on offset-binary codes and their size in volts.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import TriggerSettings
from drivers.ring_buffer import RingBuffer
from drivers.trigger import LevelTrigger, check_trigger
from drivers.usb_stream import Progress

MINIMUM_BASELINE_SAMPLES = 1000
"""The baseline is a median; fewer samples would leave it to the noise."""


class Collector:
    """Keeps the first samples of a run."""

    def __init__(self, samples: int) -> None:
        self._wanted = samples
        self.codes: NDArray[np.uint16] | None = None

    def take(self, block: NDArray[np.uint16], first: int, ring: RingBuffer) -> Progress:
        """Take a copy once enough samples are in the ring; ``DONE`` with the last sample.

        ``block`` holds the newest samples, the first of them at position ``first`` of the stream;
        the ring has them already.
        """
        if first + block.size < self._wanted:
            return Progress.NOTHING
        self.codes = ring.copy(0, self._wanted)
        return Progress.DONE


class TriggeredCapture:
    """One record around a trigger; ConfigurationError if the settings describe none.

    The baseline is the median of the samples streamed before the trigger is armed, at least
    `MINIMUM_BASELINE_SAMPLES` and at least the pre-trigger part, so a record never lacks any of
    that part.
    """

    def __init__(self, trigger: TriggerSettings, volts_per_code: float) -> None:
        check_trigger(trigger)
        self._settings = trigger
        self._volts_per_code = volts_per_code
        self._search: LevelTrigger | None = None
        self.record_samples = trigger.record_samples
        self.fill_samples = max(trigger.pre_trigger_samples, MINIMUM_BASELINE_SAMPLES)
        self.trigger_position: int | None = None
        self.trigger_monotonic_ns: int | None = None
        self.codes: NDArray[np.uint16] | None = None

    @property
    def armed(self) -> bool:
        """Whether the pre-trigger part is filled and an impact would be seen."""
        return self._search is not None

    @property
    def triggered(self) -> bool:
        """Whether the trigger condition was met."""
        return self.trigger_monotonic_ns is not None

    @property
    def complete(self) -> bool:
        """Whether every sample of the record is there."""
        return self.codes is not None

    @property
    def first_position(self) -> int:
        """Position in the stream of the record's first sample; valid once triggered. [1]"""
        if self.trigger_position is None:
            raise ValueError("no trigger yet")
        return self.trigger_position - self._settings.pre_trigger_samples

    def take(self, block: NDArray[np.uint16], first: int, ring: RingBuffer) -> Progress:
        """Look at the next block: ``CHANGED`` when it armed or triggered, ``DONE`` with the last
        sample.

        ``block`` holds the newest samples, the first of them at position ``first`` of the stream;
        the ring has them already.
        """
        progress = Progress.NOTHING
        if self._search is None:
            if first + block.size < self.fill_samples:
                return Progress.NOTHING
            self._arm(ring)
            progress = Progress.CHANGED
            skip = max(0, self.fill_samples - first)
            block, first = block[skip:], first + skip
        if self.trigger_position is None:
            if not self._look_for_trigger(block, first):
                return progress
            progress = Progress.CHANGED
        end = self.first_position + self._settings.record_samples
        if first + block.size >= end:
            self.codes = ring.copy(self.first_position, self._settings.record_samples)
            return Progress.DONE
        return progress

    def _arm(self, ring: RingBuffer) -> None:
        baseline_code = float(np.median(ring.copy(0, self.fill_samples)))
        self._search = LevelTrigger(
            baseline_code,
            self._settings.level_v / self._volts_per_code,
            self._settings.hysteresis_v / self._volts_per_code,
        )

    def _look_for_trigger(self, block: NDArray[np.uint16], first: int) -> bool:
        assert self._search is not None
        hit = self._search.search(block)
        if hit is None:
            return False
        self.trigger_position = first + hit
        self.trigger_monotonic_ns = time.monotonic_ns()
        return True
