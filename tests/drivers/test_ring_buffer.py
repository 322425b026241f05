"""Tests of the ring buffer."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.errors import ConfigurationError, RecordError
from drivers.ring_buffer import RingBuffer


def _count(first: int, count: int) -> np.ndarray:
    return (np.arange(first, first + count) % 65536).astype(np.uint16)


@given(
    capacity=st.integers(1, 50),
    blocks=st.lists(st.integers(0, 120), max_size=20),
    data=st.data(),
)
@settings(max_examples=200, deadline=None)
def test_a_copy_is_the_stream_at_that_position(capacity, blocks, data):
    """Whatever still lies in the ring comes out as it went in."""
    ring = RingBuffer(capacity)
    for size in blocks:
        assert ring.append(_count(ring.written, size)) + size == ring.written
    assert ring.oldest == max(0, sum(blocks) - capacity)
    first = data.draw(st.integers(ring.oldest, ring.written))
    count = data.draw(st.integers(0, ring.written - first))
    np.testing.assert_array_equal(ring.copy(first, count), _count(first, count))


def test_overwritten_samples_are_refused():
    """A record that was read too late is an error, not old data."""
    ring = RingBuffer(10)
    ring.append(_count(0, 15))
    with pytest.raises(RecordError, match="overwritten"):
        ring.copy(4, 5)


def test_samples_that_have_not_come_are_refused():
    """Nobody gets samples from the future."""
    ring = RingBuffer(10)
    ring.append(_count(0, 5))
    with pytest.raises(RecordError, match="the stream has 5"):
        ring.copy(3, 3)


def test_an_empty_ring_is_refused():
    """A ring without room cannot be made."""
    with pytest.raises(ConfigurationError):
        RingBuffer(0)


def test_clear_begins_a_new_stream():
    """Positions count from zero again."""
    ring = RingBuffer(10)
    ring.append(_count(0, 15))
    ring.clear()
    assert ring.append(_count(7, 3)) == 0
    np.testing.assert_array_equal(ring.copy(0, 3), _count(7, 3))


def test_a_copy_made_while_the_writer_runs_is_whole_or_refused():
    """A reader never sees a mixture of old and new samples."""
    ring = RingBuffer(5000)
    stop = threading.Event()

    def write() -> None:
        while not stop.is_set():
            ring.append(_count(ring.written, 700))

    writer = threading.Thread(target=write)
    writer.start()
    try:
        good = 0
        for _ in range(3000):
            first = ring.oldest
            count = min(4000, ring.written - first)
            try:
                samples = ring.copy(first, count)
            except RecordError:
                continue
            np.testing.assert_array_equal(samples, _count(first, count))
            good += 1
    finally:
        stop.set()
        writer.join()
    assert good
