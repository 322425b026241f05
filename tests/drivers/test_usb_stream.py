"""Tests of the streaming thread, with sources written for the purpose."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from drivers.errors import AbortedError, DeviceLostError, DeviceTimeoutError, ProtocolError
from drivers.ring_buffer import RingBuffer
from drivers.triggered_capture import Collector
from drivers.usb_stream import Progress, SampleStream


class Board:
    """Writes down what is asked of it."""

    def __init__(self, stop_error=None):
        self.calls = []
        self.pacer_on_s = None
        self._stop_error = stop_error

    def start_acquiring(self):
        """Start."""
        self.calls.append("start")
        return 1

    def acquisition_status(self):
        """Return the status."""
        self.calls.append("status")
        return 2

    def stop_acquiring(self):
        """Stop."""
        self.calls.append("stop")
        if self._stop_error is not None:
            raise self._stop_error


class Source:
    """Hands out prepared transfers, then nothing."""

    def __init__(self, *transfers):
        self.transfers = list(transfers)
        self.calls = []
        self.idle = threading.Event()

    def queue(self):
        """Queue."""
        self.calls.append("queue")

    def cancel(self):
        """Cancel."""
        self.calls.append("cancel")

    def read_into(self, buffer):
        """Fill the buffer with the next transfer."""
        if not self.transfers:
            self.idle.wait(0.01)
            return 0
        item = self.transfers.pop(0)
        if isinstance(item, Exception):
            raise item
        memoryview(buffer)[: len(item)] = item
        return len(item)


def _bytes(first, count):
    return np.arange(first, first + count, dtype="<u2").tobytes()


def _stream(source, board, consumer, **options):
    ring = RingBuffer(10_000)
    return ring, SampleStream(source, board, ring, consumer, transfer_bytes=1024, **options)


def _run(stream):
    stream.start()
    assert stream.join(10.0)


def test_a_run_starts_reads_checks_and_stops_in_this_order():
    """Start, data, status, stop: always from one thread."""
    board, source = Board(), Source(_bytes(0, 512), _bytes(512, 100), _bytes(612, 512))
    collector = Collector(700)
    _, stream = _stream(source, board, collector)
    _run(stream)
    assert board.calls == ["start", "status", "stop"]
    assert source.calls == ["queue", "cancel"]
    assert stream.status_words == (1, 2)
    np.testing.assert_array_equal(collector.codes, np.arange(700))


def test_short_transfers_lose_nothing():
    """A transfer may end anywhere between two samples."""
    sizes = [2, 256, 34, 512, 6]
    ends = np.cumsum(sizes)
    source = Source(*[_bytes(end - size, size) for end, size in zip(ends, sizes, strict=True)])
    collector = Collector(int(ends[-1]))
    _, stream = _stream(source, Board(), collector)
    _run(stream)
    np.testing.assert_array_equal(collector.codes, np.arange(ends[-1]))


def test_a_transfer_that_ends_inside_a_sample_ends_the_run():
    """Half a sample would turn all later ones into nonsense."""
    board = Board()
    _, stream = _stream(Source(_bytes(0, 10)[:-1]), board, Collector(100))
    _run(stream)
    with pytest.raises(ProtocolError, match="inside a sample"):
        stream.wait_until(lambda: False, 1.0)
    assert board.calls[-1] == "stop"


def test_silence_is_a_fault():
    """A board that says nothing for 0.2 s has stopped."""
    board = Board()
    _, stream = _stream(Source(), board, Collector(100))
    _run(stream)
    with pytest.raises(DeviceTimeoutError, match="No sample arrived"):
        stream.wait_until(lambda: False, 1.0)
    assert board.calls[-1] == "stop"


def test_an_error_of_the_consumer_stops_the_board():
    """Whatever goes wrong, the converter does not run on."""

    class Broken:
        def take(self, block, first, ring):
            raise ZeroDivisionError

    board = Board()
    _, stream = _stream(Source(_bytes(0, 10)), board, Broken())
    _run(stream)
    with pytest.raises(ZeroDivisionError):
        stream.wait_until(lambda: False, 1.0)
    assert board.calls == ["start", "stop"]


def test_the_first_error_is_the_one_that_is_told():
    """A lost board cannot be stopped either; that is not the news."""
    lost = DeviceLostError("gone")
    board = Board(stop_error=DeviceLostError("cannot stop"))
    _, stream = _stream(Source(lost), board, Collector(100))
    _run(stream)
    assert stream.error is lost


def test_a_failed_stop_is_told_when_nothing_else_went_wrong():
    """A converter that may still run is news."""
    failed = ProtocolError("cannot stop")
    _, stream = _stream(Source(_bytes(0, 200)), Board(stop_error=failed), Collector(100))
    _run(stream)
    assert stream.error is failed


def test_a_stop_from_another_thread_ends_the_wait():
    """Nobody waits for a record that cannot come."""

    class Endless:
        def take(self, block, first, ring):
            return Progress.NOTHING

    source = Source(*[_bytes(0, 512)] * 10_000)
    _, stream = _stream(source, Board(), Endless())
    stream.start()
    threading.Timer(0.05, stream.request_stop).start()
    with pytest.raises(AbortedError, match="stopped"):
        stream.wait_until(lambda: False, 30.0)


def test_the_observer_sees_each_block_in_the_ring():
    """Counting and live displays read what the trigger reads."""
    seen = []

    def observe(ring, first, count):
        seen.append(ring.copy(first, count))

    source = Source(_bytes(0, 512), _bytes(512, 100))
    _, stream = _stream(source, Board(), Collector(600), observe=observe)
    _run(stream)
    np.testing.assert_array_equal(np.concatenate(seen), np.arange(612))
