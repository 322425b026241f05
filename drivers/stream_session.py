"""One run at a time on a streaming board: collect, arm, wait, stop, from any thread.

This is the same for every streaming digitizer of this project; a board adds its source of bytes
and its start and stop sequences.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import TriggerSettings
from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceTimeoutError,
    DriverError,
    ProtocolError,
    TriggerTimeoutError,
)
from drivers.pace import Pace
from drivers.ring_buffer import RingBuffer
from drivers.triggered_capture import Collector, TriggeredCapture
from drivers.usb_stream import BulkSource, Observer, SampleStream, StreamingBoard

_START_LIMIT_S = 10.0
_STOP_LIMIT_S = 5.0
_BREAKING = (DeviceLostError, DeviceTimeoutError, ProtocolError)


class StreamSession:
    """Runs of one board, never two at once; each method raises whatever ended its run early.

    ``observe`` sees each block inside the ring: ``(ring, first, count)``. ``make_pace`` makes what
    compares the count of a record's samples with the clock. ``last_capture`` and ``last_pace`` are
    of the run that ended last or is on: what came of it before it broke is in the ring.
    """

    def __init__(
        self,
        ring: RingBuffer,
        *,
        sample_rate_hz: float,
        transfer_bytes: int,
        observe: Observer | None = None,
        make_pace: Callable[[], Pace] | None = None,
    ) -> None:
        self._ring = ring
        self._sample_rate_hz = sample_rate_hz
        self._transfer_bytes = transfer_bytes
        self._observe = observe
        self._make_pace = make_pace
        self.last_capture: TriggeredCapture | None = None
        self.last_pace: Pace | None = None
        self._switching = threading.Lock()
        self._run: SampleStream | None = None
        self._capture: TriggeredCapture | None = None
        self._broken = False

    @property
    def broken(self) -> bool:
        """Whether the last run ended in such a way that the board must be opened again."""
        run = self._run
        return self._broken or (run is not None and isinstance(run.error, _BREAKING))

    def collect(
        self, source: BulkSource, board: StreamingBoard, samples: int
    ) -> tuple[NDArray[np.uint16], tuple[int, ...]]:
        """Run until so many samples are there.

        Return offset-binary codes, shape (samples,), and the status words.
        """
        self._check_fits(samples)
        collector = Collector(samples)
        run = self._start(source, board, collector, None)
        with self._stopped_on_error():
            self._await(run, lambda: run.finished, samples)
            if collector.codes is None:
                raise AbortedError("The digitizer was stopped while its input was sampled.")
        self.stop()
        return collector.codes, run.status_words

    def arm(
        self,
        source: BulkSource,
        board: StreamingBoard,
        trigger: TriggerSettings,
        volts_per_code: float,
    ) -> None:
        """Start a run that ends with one record, and wait until an impact would be seen."""
        capture = TriggeredCapture(trigger, volts_per_code)
        self._check_fits(max(trigger.record_samples, capture.fill_samples))
        run = self._start(source, board, capture, capture)
        with self._stopped_on_error():
            self._await(run, lambda: capture.armed, capture.fill_samples)

    def wait_trigger(self, timeout_s: float, abort: threading.Event) -> int:
        """Return the host's monotonic clock at the trigger. [ns]

        ``abort`` ends the wait when set. The run is stopped after any DriverError, which says what
        ended the wait.
        """
        run, capture = self._awaited()
        with self._stopped_on_error():
            self._await_trigger(run, capture, timeout_s, abort)
        assert capture.trigger_monotonic_ns is not None
        return capture.trigger_monotonic_ns

    def wait_capture(
        self, timeout_s: float, abort: threading.Event
    ) -> tuple[TriggeredCapture, tuple[int, ...]]:
        """Return the complete capture and the status words.

        ``timeout_s`` is for the trigger; ``abort`` ends the wait when set. The run is stopped after
        any DriverError, which says what ended the wait.
        """
        run, capture = self._awaited()
        with self._stopped_on_error():
            self._await_trigger(run, capture, timeout_s, abort)
            # Not "complete" but "finished": the status words are read after the last sample.
            self._await(
                run, lambda: run.finished and capture.complete, capture.record_samples, abort
            )
        self.stop()
        return capture, run.status_words

    def stop(self) -> None:
        """End the present run, if any, and wait for its end.

        A DeviceTimeoutError says that the stream's thread does not end, which no transfer time-out
        allows.
        """
        with self._switching:
            run = self._run
        if run is None:
            return
        run.request_stop()
        if not run.join(_STOP_LIMIT_S):
            raise DeviceTimeoutError(
                f"The stream did not end within {_STOP_LIMIT_S:.0f} s.",
                why="A USB transfer hangs in the kernel.",
                remedy="Unplug the digitizer.",
            )
        with self._switching:
            if self._run is run:
                self._broken = isinstance(run.error, _BREAKING)
                self._run = None
                self._capture = None

    def _start(
        self,
        source: BulkSource,
        board: StreamingBoard,
        consumer: Collector | TriggeredCapture,
        capture: TriggeredCapture | None,
    ) -> SampleStream:
        with self._switching:
            if self._run is not None and not self._run.finished:
                raise DeviceBusyError(
                    "The digitizer is armed already.",
                    why="Another part of this program waits for a record.",
                    remedy="Wait for its end or abort it.",
                )
            self._broken = False
            self.last_capture = capture
            pace = self._make_pace() if self._make_pace else None
            self.last_pace = pace if capture else None
            self._run = SampleStream(
                source,
                board,
                self._ring,
                consumer,
                transfer_bytes=self._transfer_bytes,
                observe=self._observe,
                pace=pace,
                proved=capture is not None,
            )
            self._capture = capture
            self._run.start()
            return self._run

    def _awaited(self) -> tuple[SampleStream, TriggeredCapture]:
        with self._switching:
            run, capture = self._run, self._capture
        if run is None or capture is None:
            raise AbortedError(
                "No record is awaited.",
                why="The digitizer was not armed, or was stopped since.",
                remedy="Arm it first.",
            )
        return run, capture

    def _await(
        self,
        run: SampleStream,
        condition: Callable[[], bool],
        samples: int,
        abort: threading.Event | None = None,
    ) -> None:
        """Wait twice as long as the samples should take, and a margin."""
        limit_s = _START_LIMIT_S + 2.0 * samples / self._sample_rate_hz
        if not run.wait_until(condition, limit_s, abort):
            raise DeviceTimeoutError(
                f"{samples} samples did not arrive within {limit_s:.1f} s.",
                why="The board streams slower than configured.",
                remedy="Check pacer_divisor and sample_rate_hz.",
            )
        if run.finished and run.error is not None:
            raise run.error

    def _await_trigger(
        self,
        run: SampleStream,
        capture: TriggeredCapture,
        timeout_s: float,
        abort: threading.Event,
    ) -> None:
        if not run.wait_until(lambda: capture.triggered, timeout_s, abort):
            raise TriggerTimeoutError(
                f"No impact was seen within {timeout_s:g} s.",
                why="The sphere did not fall, missed the coupon, or the trigger level is too high.",
                remedy="Look at the rig; then check the trigger level against the last shots.",
            )

    def _check_fits(self, samples: int) -> None:
        # The newest transfer may reach beyond the record's end; keep room for two.
        spare = self._transfer_bytes
        if not 0 < samples <= self._ring.capacity_samples - spare:
            raise ConfigurationError(
                f"{samples} samples do not fit the ring of {self._ring.capacity_samples} "
                f"(two transfers, {spare} samples, are kept free).",
                remedy="Raise ring_seconds or shorten the record.",
            )

    @contextmanager
    def _stopped_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            with suppress(DriverError):  # the first error explains the end
                self.stop()
            raise
