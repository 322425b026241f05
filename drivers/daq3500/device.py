"""The digitizer the daemon sees: open, arm, wait, stop. Untested on a 3500."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.daq3500.opening import OpenedBoard, open_board
from drivers.daq3500.registers import ENDPOINT_IN
from drivers.daq3500.sequences import Daq3500Converter
from drivers.daq3500.settings import Daq3500Settings
from drivers.daq3500.status import check_status
from drivers.digitizer import DigitizerIdentity, Record, TriggerSettings
from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceTimeoutError,
    DriverError,
    TriggerTimeoutError,
)
from drivers.ring_buffer import RingBuffer
from drivers.triggered_capture import Collector, TriggeredCapture
from drivers.usb_stream import Observer, SampleStream, SynchronousBulkSource
from drivers.wire_log import CapturingBackend

_WARM_UP_SAMPLES = 8192
_START_LIMIT_S = 2.0
_STOP_LIMIT_S = 2.0


class Daq3500:
    """A `drivers.digitizer.Digitizer` on the Personal Daq/3000 protocol.

    Parameters
    ----------
    settings : Daq3500Settings
        Which board, which input, which rate.
    backend : usb.backend.IBackend, optional
        ``None`` for libusb 1.0; a simulated one otherwise.
    observe : callable, optional
        Sees each block inside the ring, in the stream's thread: ``(ring, first, count)``.

    Notes
    -----
    All methods may be called from any thread. One run at a time: `arm` and `sample_baseline`
    refuse while another run is on. Whatever ends a wait early also stops the converter.
    """

    def __init__(
        self,
        settings: Daq3500Settings,
        *,
        backend: Any = None,
        observe: Observer | None = None,
    ) -> None:
        self._settings = settings
        self._log: CapturingBackend | None = None
        if settings.wire_log_file is not None:
            self._log = CapturingBackend(
                settings.wire_log_file, backend, keep_data=settings.wire_log_data
            )
            backend = self._log
        self._backend = backend
        self._observe = observe
        self._ring = RingBuffer(settings.ring_samples)
        self._opening = threading.RLock()
        self._switching = threading.Lock()
        self._board: OpenedBoard | None = None
        self._run: SampleStream | None = None
        self._capture: TriggeredCapture | None = None

    @property
    def identity(self) -> DigitizerIdentity:
        """Who the board is.

        Raises
        ------
        DriverError
            Before `ensure_ready`.
        """
        return self._ready_board().identity

    @property
    def samples_streamed(self) -> int:
        """Samples received in the present or last run. [1]"""
        return self._ring.written

    def ensure_ready(self) -> None:
        """Find, load, test and calibrate the board; do nothing when that was done.

        A board that was lost is looked for again.

        Raises
        ------
        DriverError
            Any of its kinds, with what to do.
        """
        with self._opening:
            self._forget_lost_board()
            if self._board is not None:
                return
            self._board = open_board(self._settings, self._backend)
            try:
                # The first conversions after power-up are discarded, as the notes say.
                self._collect(_WARM_UP_SAMPLES)
            except BaseException:
                self._give_back()
                raise

    def sample_baseline(self, samples: int) -> NDArray[np.float64]:
        """Return so many samples of the idle input.

        Parameters
        ----------
        samples : int
            How many; at most what the ring holds. [1]

        Returns
        -------
        ndarray of float64, shape (samples,)
            Calibrated where the board is. [V]

        Raises
        ------
        DeviceBusyError
            If a record is awaited.
        OverrunError
            If samples were lost.
        """
        codes = self._collect(samples)
        calibration = self._ready_board().calibration
        volts = _signed(codes).astype(np.float64) * calibration.volts_per_code
        return np.asarray(volts + calibration.offset_v, dtype=np.float64)

    def arm(self, trigger: TriggerSettings) -> None:
        """Start streaming and return once the pre-trigger part is filled.

        Parameters
        ----------
        trigger : TriggerSettings
            When the record begins and how long it is.

        Raises
        ------
        ConfigurationError
            If the record does not fit the ring or no code reaches the level.
        DeviceBusyError
            If a record is awaited already.
        AbortedError
            If another thread stopped the digitizer meanwhile.
        """
        capture = TriggeredCapture(trigger, self._ready_board().calibration.volts_per_code)
        self._check_fits(max(trigger.record_samples, capture.fill_samples))
        run = self._start(capture, capture)
        with self._stopped_on_error():
            rate_hz = self._settings.sample_rate_hz
            _wait_or_fail(run, lambda: capture.armed, capture.fill_samples, rate_hz)

    def wait_trigger(self, timeout_s: float, abort: threading.Event) -> int:
        """Return the host clock at the trigger, before the record is full.

        Parameters
        ----------
        timeout_s : float
            Longest wait. [s]
        abort : threading.Event
            Ends the wait within 20 ms when set.

        Returns
        -------
        int
            Monotonic clock when the trigger was recognised. [ns]

        Raises
        ------
        TriggerTimeoutError, AbortedError, DriverError
            The converter is stopped then.
        """
        run, capture = self._awaited()
        with self._stopped_on_error():
            self._wait_trigger(run, capture, timeout_s, abort)
        assert capture.trigger_monotonic_ns is not None
        return capture.trigger_monotonic_ns

    def wait_record(self, timeout_s: float, abort: threading.Event) -> Record:
        """Return the record.

        Parameters
        ----------
        timeout_s : float
            Longest wait for the trigger; the rest of the record has its own limit. [s]
        abort : threading.Event
            Ends the wait within 20 ms when set.

        Returns
        -------
        Record
            Whole, with status words that say that no sample was lost.

        Raises
        ------
        TriggerTimeoutError, OverrunError, RecordError, AbortedError, DriverError
            The converter is stopped then. An `OverrunError` carries the damaged record.
        """
        run, capture = self._awaited()
        with self._stopped_on_error():
            self._wait_trigger(run, capture, timeout_s, abort)
            # Not "complete" but "finished": the status words are read after the last sample.
            _wait_or_fail(
                run,
                lambda: run.finished and capture.complete,
                capture.record_samples,
                self._settings.sample_rate_hz,
                abort,
            )
        self.ensure_stopped()
        record = self._record(run, capture)
        check_status(record.status_words, record)
        return record

    def ensure_stopped(self) -> None:
        """Stop and drain; safe to call at any time, in any state, from any thread.

        Raises
        ------
        DeviceTimeoutError
            If the stream's thread does not end, which no transfer time-out allows.
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
                self._run = None
                self._capture = None
        if isinstance(run.error, DeviceLostError):
            self._forget_lost_board(lost=True)

    def close(self) -> None:
        """Stop and give the board back; waiting threads get an `AbortedError`."""
        try:
            self.ensure_stopped()
        finally:
            with self._opening:
                self._give_back()
            if self._log is not None:
                self._log.close()

    def _ready_board(self) -> OpenedBoard:
        board = self._board
        if board is None:
            raise DriverError(
                "The digitizer is not ready.",
                why="It was not opened, was closed or was lost.",
                remedy="Call ensure_ready first.",
            )
        return board

    def _forget_lost_board(self, *, lost: bool = False) -> None:
        with self._opening:
            run = self._run
            if lost or (run is not None and isinstance(run.error, DeviceLostError)):
                self._give_back()

    def _give_back(self) -> None:
        board, self._board = self._board, None
        if board is not None:
            with suppress(DriverError):  # it may be gone, which is as good as closed
                board.link.dispose()

    def _check_fits(self, samples: int) -> None:
        # The newest transfer may reach beyond the record's end; keep room for two.
        spare = self._settings.transfer_bytes
        if not 0 < samples <= self._ring.capacity_samples - spare:
            raise ConfigurationError(
                f"{samples} samples do not fit the ring of {self._ring.capacity_samples} "
                f"(two transfers, {spare} samples, are kept free).",
                remedy="Raise ring_seconds or shorten the record.",
            )

    def _start(
        self, consumer: Collector | TriggeredCapture, capture: TriggeredCapture | None
    ) -> SampleStream:
        board = self._ready_board()
        with self._switching:
            if self._run is not None and not self._run.finished:
                raise DeviceBusyError(
                    "The digitizer is armed already.",
                    why="Another part of this program waits for a record.",
                    remedy="Wait for its end or abort it.",
                )
            self._run = SampleStream(
                SynchronousBulkSource(board.link.device, ENDPOINT_IN),
                Daq3500Converter(board.link, self._settings),
                self._ring,
                consumer,
                transfer_bytes=self._settings.transfer_bytes,
                observe=self._observe,
            )
            self._capture = capture
            self._run.start()
            return self._run

    def _collect(self, samples: int) -> NDArray[np.uint16]:
        self._check_fits(samples)
        collector = Collector(samples)
        run = self._start(collector, None)
        with self._stopped_on_error():
            _wait_or_fail(run, lambda: run.finished, samples, self._settings.sample_rate_hz)
            if collector.codes is None:
                raise AbortedError("The digitizer was stopped while its input was sampled.")
        self.ensure_stopped()
        check_status(run.status_words)
        return collector.codes

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

    def _wait_trigger(
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

    @contextmanager
    def _stopped_on_error(self) -> Iterator[None]:
        try:
            yield
        except BaseException:
            with suppress(DriverError):  # the first error explains the end
                self.ensure_stopped()
            raise

    def _record(self, run: SampleStream, capture: TriggeredCapture) -> Record:
        assert capture.codes is not None
        assert capture.trigger_position is not None
        assert capture.trigger_monotonic_ns is not None
        calibration = self._ready_board().calibration
        return Record(
            codes=_signed(capture.codes),
            volts_per_code=calibration.volts_per_code,
            offset_v=calibration.offset_v,
            calibrated=calibration.calibrated,
            sample_rate_hz=self._settings.sample_rate_hz,
            sample_rate_u_hz=self._settings.sample_rate_u_hz,
            range_v=self._settings.range_v,
            trigger_index=capture.trigger_position - capture.first_position,
            first_sample_index=capture.first_position,
            trigger_monotonic_ns=capture.trigger_monotonic_ns,
            status_words=run.status_words,
            samples_streamed=self._ring.written,
        )


def _signed(codes: NDArray[np.uint16]) -> NDArray[np.int16]:
    """Return offset-binary codes as signed ones."""
    return (codes ^ np.uint16(0x8000)).view(np.int16)


def _wait_or_fail(
    run: SampleStream,
    condition: Callable[[], bool],
    samples: int,
    rate_hz: float,
    abort: threading.Event | None = None,
) -> None:
    """Wait twice as long as the samples should take, and a margin."""
    limit_s = _START_LIMIT_S + 2.0 * samples / rate_hz
    if not run.wait_until(condition, limit_s, abort):
        raise DeviceTimeoutError(
            f"{samples} samples did not arrive within {limit_s:.1f} s.",
            why="The board streams slower than configured.",
            remedy="Check pacer_divisor and sample_rate_hz.",
        )
    if run.finished and run.error is not None:
        raise run.error
