"""The 1 MS/s path from a bulk endpoint into a ring buffer, in its own thread.

Three narrow seams meet here: a `BulkSource` fills byte buffers (synchronous today; queued
asynchronous transfers can replace it without touching anything else), a `StreamingBoard` knows
how a converter is started and stopped, a `BlockConsumer` looks at each block (a trigger, a plain
collector).
"""

from __future__ import annotations

import array
import enum
import threading
import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drivers.errors import AbortedError, DeviceTimeoutError, ProtocolError
from drivers.pace import BEGINNING_SAMPLES, CATCH_UP_S, PATIENCE_S, Pace
from drivers.ring_buffer import RingBuffer

SILENCE_LIMIT_S = 0.2
"""No sample for so long is a fault; a source that times out after 0.1 s shows it within 0.25 s."""

_SHORT_BYTES = 1024
_STARTS = 5


class BulkSource(Protocol):
    """Fills buffers with the bytes of one endpoint, in order."""

    def queue(self) -> None:
        """Prepare for data; called before the converter starts."""

    def read_into(self, buffer: array.array[int]) -> int:
        """Fill `buffer` from its start and return the number of bytes, 0 after a time-out."""

    def cancel(self) -> None:
        """Give up what is queued; called after the converter has stopped."""


class StreamingBoard(Protocol):
    """A board whose converter can be started and stopped.

    ``pacer_on_s`` is just before and just after the command that started it, on the monotonic
    clock.
    """

    pacer_on_s: tuple[float, float] | None

    def start_acquiring(self) -> int:
        """Start the converter and return the status word."""

    def acquisition_status(self) -> int:
        """Return the status word."""

    def stop_acquiring(self) -> None:
        """Stop the converter and drain the endpoint."""


class Progress(enum.Enum):
    """What a block meant to its consumer."""

    NOTHING = enum.auto()
    CHANGED = enum.auto()
    DONE = enum.auto()


class BlockConsumer(Protocol):
    """Looks at each block after it was stored."""

    def take(self, block: NDArray[np.uint16], first: int, ring: RingBuffer) -> Progress:
        """Look at the block at position `first`, which is in the ring already."""


Observer = Callable[[RingBuffer, int, int], None]
"""Called in the stream's thread with the ring, the first position and the count of a block."""


class SampleStream:
    """One run of the converter: start, read, hand to the consumer, stop.

    The thread sends every command of the run itself, so the order on the wire never depends on who
    waits for what. Errors are kept for the thread that waits.

    The ring is cleared at the start; ``transfer_bytes`` is a multiple of 512. ``observe`` sees each
    block inside the ring; ``pace`` compares the count of samples with the clock. If ``proved``, the
    run goes on behind its last sample until a transfer proves that none was lost, as long as
    `drivers.pace` has patience.
    """

    def __init__(
        self,
        source: BulkSource,
        board: StreamingBoard,
        ring: RingBuffer,
        consumer: BlockConsumer,
        *,
        transfer_bytes: int,
        observe: Observer | None = None,
        pace: Pace | None = None,
        proved: bool = False,
    ) -> None:
        self._source = source
        self._board = board
        self._ring = ring
        self._consumer = consumer
        self._buffer = array.array("B", bytes(transfer_bytes))
        self._samples: NDArray[np.uint16] = np.frombuffer(self._buffer, dtype="<u2")
        self._short_buffer = array.array("B", bytes(_SHORT_BYTES))
        self._short_samples: NDArray[np.uint16] = np.frombuffer(self._short_buffer, dtype="<u2")
        self._observe = observe
        self._pace = pace
        self._proved = proved
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sample-stream", daemon=True)
        self._error: Exception | None = None
        self._finished = False
        self._status_words: list[int] = []
        self.changed = threading.Condition()

    @property
    def finished(self) -> bool:
        """Whether the converter is stopped and the endpoint drained."""
        return self._finished

    @property
    def error(self) -> Exception | None:
        """What ended the run early, if anything did."""
        return self._error

    @property
    def stop_requested(self) -> bool:
        """Whether somebody asked for an end."""
        return self._stop.is_set()

    @property
    def status_words(self) -> tuple[int, ...]:
        """Acquisition status at start and end, as far as they were read."""
        return tuple(self._status_words)

    def start(self) -> None:
        """Start the thread, which starts the converter."""
        self._thread.start()

    def request_stop(self) -> None:
        """Ask for an end; returns at once."""
        self._stop.set()

    def join(self, timeout_s: float) -> bool:
        """Wait for the end of the run, at most so long."""
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def wait_until(
        self,
        condition: Callable[[], bool],
        timeout_s: float,
        abort: threading.Event | None = None,
        poll_s: float = 0.005,
    ) -> bool:
        """Wait until a condition holds; ``False`` means that time is up.

        It is checked after every change and every ``poll_s``. An AbortedError says that ``abort``
        was set, or that the run was stopped before the condition held; any other error is what
        ended the run.
        """
        deadline_s = time.monotonic() + timeout_s
        with self.changed:
            while not condition():
                if self._error is not None:
                    raise self._error
                if abort is not None and abort.is_set():
                    raise AbortedError("The wait for the digitizer was aborted.")
                if self._finished:
                    raise AbortedError("The digitizer was stopped while a record was awaited.")
                remaining_s = deadline_s - time.monotonic()
                if remaining_s <= 0:
                    return False
                self.changed.wait(min(remaining_s, poll_s))
        return True

    def _run(self) -> None:
        try:
            self._ring.clear()
            self._source.queue()
            self._status_words.append(self._start())
            self._pump()
            self._status_words.append(self._board.acquisition_status())
        except Exception as error:
            self._error = error  # raised again in the thread that waits
        finally:
            self._end()

    def _start(self) -> int:
        """Start the converter, again if the host was interrupted: no sample counts yet."""
        for _ in range(_STARTS):
            status = self._board.start_acquiring()
            began_s = self._board.pacer_on_s
            if self._pace is None or began_s is None:
                break
            if self._pace.started(*began_s) or not self._proved:
                break
        return status

    def _end(self) -> None:
        try:
            self._board.stop_acquiring()
            self._source.cancel()
        except Exception as error:
            # The first error explains the end; a lost board cannot be stopped either.
            self._error = self._error or error
        finally:
            with self.changed:
                self._finished = True
                self.changed.notify_all()

    def _pump(self) -> None:
        last_data_s = time.monotonic()
        while not self._stop.is_set():
            begins = (
                self._pace is not None and self._proved and (self._ring.written < BEGINNING_SAMPLES)
            )
            buffer = self._short_buffer if begins else self._buffer
            received = self._source.read_into(buffer)
            if received == 0:
                silent_s = time.monotonic() - last_data_s
                if silent_s >= SILENCE_LIMIT_S:
                    raise DeviceTimeoutError(
                        f"No sample arrived for {silent_s:.2f} s while streaming.",
                        why="The converter stopped or the board's firmware hangs.",
                        remedy="Switch the digitizer's power off and on.",
                    )
                continue
            last_data_s = time.monotonic()
            if received % 2:
                raise ProtocolError(
                    f"A transfer ended inside a sample ({received} bytes).",
                    why="Bytes were lost; every later sample would be wrong.",
                    remedy="Check the cable, then repeat the drop.",
                )
            block = (self._short_samples if begins else self._samples)[: received // 2]
            done = self._take(block)
            if self._pace is not None:
                self._pace.arrived(self._ring.written, last_data_s)
            if done:
                if self._pace is not None and self._proved:
                    self._wait_for_proof(self._pace, last_data_s)
                return

    def _wait_for_proof(self, pace: Pace, done_s: float) -> None:
        """Read on until a transfer arrives on time: then nothing was lost before it.

        A host that lags behind is given the time to catch up, in long transfers, which cost the
        least: nothing is lost while the board can hold it. Then in short ones, so that it gets many
        chances to be there in time.
        """
        count = self._ring.written
        best_s, until_s = float("inf"), 0.0
        while not pace.on_time and time.monotonic() - done_s < CATCH_UP_S:
            if pace.late_s < best_s - PATIENCE_S / 100:
                best_s, until_s = pace.late_s, time.monotonic() + PATIENCE_S
            idle = self._stop.is_set() or time.monotonic() > until_s
            lags = pace.late_samples > self._samples.size
            buffer = self._buffer if lags else self._short_buffer
            received = 0 if idle else self._source.read_into(buffer)
            if received == 0:
                return
            count += received // 2
            pace.arrived(count, time.monotonic())

    def _take(self, block: NDArray[np.uint16]) -> bool:
        first = self._ring.append(block)
        if self._observe is not None:
            self._observe(self._ring, first, block.size)
        progress = self._consumer.take(block, first, self._ring)
        if progress is not Progress.NOTHING:
            with self.changed:
                self.changed.notify_all()
        return progress is Progress.DONE
