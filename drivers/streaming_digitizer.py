"""The digitizer the daemon sees, on any board that streams: open, arm, wait, stop.

A board adds how it is opened, how its converter is started and stopped, and what its status words
mean.
"""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from contextlib import suppress
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import DigitizerIdentity, Record, TriggerSettings
from drivers.errors import AbortedError, DriverError
from drivers.opened_board import LinkT, OpenedBoard
from drivers.pace import Latency, Pace, check_pace, check_repeats
from drivers.ring_buffer import RingBuffer
from drivers.stream_session import StreamSession
from drivers.stream_settings import StreamSettings
from drivers.triggered_capture import TriggeredCapture
from drivers.usb_stream import BulkSource, Observer, StreamingBoard
from drivers.wire_log import CapturingBackend

SettingsT = TypeVar("SettingsT", bound=StreamSettings)

_WARM_UP_SAMPLES = 8192


class StreamingDigitizer(ABC, Generic[SettingsT, LinkT]):
    """A `drivers.digitizer.Digitizer` on a board that streams over USB.

    Parameters
    ----------
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
        settings: SettingsT,
        *,
        backend: Any = None,
        observe: Observer | None = None,
    ) -> None:
        self._settings = settings
        self._backend = backend
        self._log: CapturingBackend | None = None
        self._ring = RingBuffer(settings.ring_samples)
        self._session = StreamSession(
            self._ring,
            sample_rate_hz=settings.sample_rate_hz,
            transfer_bytes=settings.transfer_bytes,
            observe=observe,
            make_pace=self._pace if settings.pace_checked and not settings.wire_log_file else None,
        )
        self._latency = Latency()
        self._opening = threading.Lock()
        self._board: OpenedBoard[LinkT] | None = None

    @abstractmethod
    def _open(self, backend: Any, *, clear_halt: bool) -> OpenedBoard[LinkT]:
        """Find, load, test and calibrate the board; give it back after any DriverError.

        ``clear_halt`` says that the last run broke, so that the endpoint may be stalled.
        """

    @abstractmethod
    def _parts(self, link: LinkT) -> tuple[BulkSource, StreamingBoard]:
        """Return what one run reads its samples from, and what starts and stops it."""

    @abstractmethod
    def _check_status(self, words: tuple[int, ...], record: Record | None) -> None:
        """Refuse samples whose status words tell of a fault; see `drivers.stream_status`."""

    @property
    def identity(self) -> DigitizerIdentity:
        """The board's identity; DriverError before `ensure_ready`."""
        return self._ready_board().identity

    @property
    def samples_streamed(self) -> int:
        """Samples received in the present or last run. [1]"""
        return self._ring.written

    def ensure_ready(self) -> None:
        """Find, load, test and calibrate the board; do nothing when that was done.

        A board that was lost, hung or stalled is looked for and opened again.

        Raises
        ------
        DriverError
            Any of its kinds, with what to do.
        """
        with self._opening:
            broken = self._session.broken
            if broken:
                with suppress(DriverError):
                    self._session.stop()
                self._give_back()
            if self._board is not None:
                return
            self._session.stop()  # a run that outlived its board must be over first
            self._latency = Latency()
            self._board = self._open(self._usb(), clear_halt=broken)
            try:
                # The first conversions after opening are discarded.
                self._collect(_WARM_UP_SAMPLES)
            except BaseException:
                # A stream that still reads would claim the board again behind our back.
                with suppress(DriverError):
                    self._session.stop()
                self._give_back()
                raise

    def sample_baseline(self, samples: int) -> NDArray[np.float64]:
        """Return so many samples of the idle input, calibrated if the board is. [V]

        At most what the ring holds.

        Raises
        ------
        DeviceBusyError
            If a record is awaited.
        OverrunError
            If samples were lost.
        """
        calibration = self._ready_board().calibration
        volts = _signed(self._collect(samples)) * np.float64(calibration.volts_per_code)
        return np.asarray(volts + calibration.offset_v, dtype=np.float64)

    def arm(self, trigger: TriggerSettings) -> None:
        """Start streaming and return once the pre-trigger part is filled.

        Raises
        ------
        ConfigurationError
            If the record does not fit the ring or no code reaches the level.
        DeviceBusyError
            If a record is awaited already.
        AbortedError
            If another thread stopped the digitizer meanwhile.
        """
        board = self._ready_board()
        self._session.arm(*self._parts(board.link), trigger, board.calibration.volts_per_code)

    def wait_trigger(self, timeout_s: float, abort: threading.Event) -> int:
        """Return the host's monotonic clock at the trigger, before the record is full. [ns]

        Setting ``abort`` ends the wait within 20 ms.

        Raises
        ------
        TriggerTimeoutError, AbortedError, DriverError
            The converter is stopped then.
        """
        return self._session.wait_trigger(timeout_s, abort)

    def wait_record(self, timeout_s: float, abort: threading.Event) -> Record:
        """Return the whole record, no sample of which was lost.

        ``timeout_s`` is for the trigger; the rest of the record has its own limit. Setting
        ``abort`` ends the wait within 20 ms.

        Raises
        ------
        TriggerTimeoutError, OverrunError, RecordError, AbortedError, DriverError
            The converter is stopped then. An `OverrunError` carries the damaged record.
        """
        try:
            capture, status_words = self._session.wait_capture(timeout_s, abort)
        except AbortedError:
            raise  # whoever asked for the end wants no evidence
        except DriverError as error:
            error.record = error.record or self._partial_record()
            raise
        assert capture.codes is not None
        record = self._record(capture, capture.codes, status_words)
        self._check_status(status_words, record)
        check_repeats(record, self._settings.transfer_bytes // 2)
        if self._session.last_pace is not None:
            check_pace(self._session.last_pace, record)
        return record

    def ensure_stopped(self) -> None:
        """Stop and drain; safe to call at any time, in any state, from any thread.

        Raises
        ------
        DeviceTimeoutError
            If the stream's thread does not end, which no transfer time-out allows.
        """
        self._session.stop()

    def close(self) -> None:
        """Stop and give the board back; waiting threads get an `AbortedError`."""
        try:
            self._session.stop()
        finally:
            with self._opening:
                self._give_back()
            if self._log is not None:
                self._log.close()

    def _usb(self) -> Any:
        path = self._settings.wire_log_file
        if path is not None and self._log is None:
            keep_data = self._settings.wire_log_data
            self._log = CapturingBackend(path, self._backend, keep_data=keep_data)
        return self._log or self._backend

    def _ready_board(self) -> OpenedBoard[LinkT]:
        board = self._board
        if board is None:
            raise DriverError(
                "The digitizer is not ready.",
                why="It was not opened, or was closed.",
                remedy="Call ensure_ready first.",
            )
        return board

    def _collect(self, samples: int) -> NDArray[np.uint16]:
        codes, status_words = self._session.collect(*self._parts(self._ready_board().link), samples)
        self._check_status(status_words, None)
        return codes

    def _give_back(self) -> None:
        board, self._board = self._board, None
        if board is not None:
            with suppress(DriverError):  # it may be gone, which is as good as closed
                board.link.dispose()

    def _pace(self) -> Pace:
        rate_hz, u_hz = self._settings.sample_rate_hz, self._settings.sample_rate_u_hz
        return Pace(rate_hz, u_hz, self._latency)

    def _partial_record(self) -> Record | None:
        """Return what is there of a triggered record whose run broke."""
        capture, board = self._session.last_capture, self._board
        if capture is None or board is None or not capture.triggered:
            return None
        first = capture.first_position
        count = min(capture.record_samples, self._ring.written - first)
        with suppress(DriverError):  # the run's own error is the one to tell
            return self._record(capture, self._ring.copy(first, count), ())
        return None

    def _record(
        self, capture: TriggeredCapture, codes: NDArray[np.uint16], status_words: tuple[int, ...]
    ) -> Record:
        assert capture.trigger_position is not None
        assert capture.trigger_monotonic_ns is not None
        calibration = self._ready_board().calibration
        return Record(
            codes=_signed(codes),
            volts_per_code=calibration.volts_per_code,
            offset_v=calibration.offset_v,
            calibrated=calibration.calibrated,
            sample_rate_hz=self._settings.sample_rate_hz,
            sample_rate_u_hz=self._settings.sample_rate_u_hz,
            range_v=self._settings.range_v,
            trigger_index=capture.trigger_position - capture.first_position,
            first_sample_index=capture.first_position,
            trigger_monotonic_ns=capture.trigger_monotonic_ns,
            status_words=status_words,
            samples_streamed=self._ring.written,
        )


def _signed(codes: NDArray[np.uint16]) -> NDArray[np.int16]:
    """Return offset-binary codes as signed ones."""
    return (codes ^ np.uint16(0x8000)).view(np.int16)
