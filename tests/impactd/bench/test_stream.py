"""Tests that the stream's benchmark counts what it says."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drivers.ring_buffer import RingBuffer
from drivers.simulated.signal_sources import COUNT_PERIOD, CountingSource
from drivers.simulated.usb_device import SimulatedDaq3500
from impactd.bench import stream
from impactd.bench.stream import SampleCounter, measure_stream


def _count(*pieces, block=1000):
    ring, counter = RingBuffer(200_000), SampleCounter()
    codes = np.concatenate([np.arange(a, b) % COUNT_PERIOD for a, b in pieces]).astype(np.uint16)
    for at in range(0, codes.size, block):
        part = codes[at : at + block]
        counter.look(ring, ring.append(part), part.size)
    return counter


@pytest.mark.parametrize("block", [1, 999, 60_001, 200_000])
def test_an_unbroken_count_has_no_fault(block):
    """Over the end of the count's period too, in blocks of any size."""
    counter = _count((0, 150_000), block=block)
    assert (counter.samples, counter.lost, counter.doubled, counter.wrong) == (150_000, 0, 0, 0)


@pytest.mark.parametrize("block", [100, 7000])
def test_each_lost_and_doubled_sample_is_counted(block):
    """One sample is enough, and several faults add up."""
    counter = _count((0, 500), (501, 3000), (2744, 9000), (9256, 70_000), (69_999, 80_000))
    assert counter.lost == 1 + 256
    assert counter.doubled == 256 + 1
    assert counter.wrong == 0


@pytest.mark.parametrize("fault", ["drop_block_at_sample", "double_block_at_sample"])
def test_a_block_that_went_wrong_on_the_wire_is_found(monkeypatch, fault):
    """The benchmark would see what the status word does not tell."""

    class Faulty(CountingSource):
        def _begin(self) -> None:
            # The first stream is the warm-up.
            if self.streams_started == 1:
                setattr(self.faults, fault, 123_456)

    monkeypatch.setattr(stream, "CountingSource", Faulty)
    result = measure_stream(0.1, flat_out=True)
    expected = (256, 0) if fault.startswith("drop") else (0, 256)
    assert (result["lost"], result["doubled"]) == expected
    assert result["wrong"] == 0


@pytest.mark.parametrize("flat_out", [True, False])
def test_the_path_loses_nothing(flat_out):
    """A moment of what `impactd bench` does for a minute."""
    result = measure_stream(0.3, flat_out=flat_out)
    assert (result["lost"], result["doubled"], result["wrong"]) == (0, 0, 0)
    assert result["samples"] > 100_000
    assert math.isfinite(result["cpu_share"])


@pytest.mark.slow
def test_a_minute_at_one_million_samples_a_second_loses_nothing():
    """Counted, not assumed."""
    result = measure_stream(60.0, flat_out=False)
    assert (result["lost"], result["doubled"], result["wrong"]) == (0, 0, 0)
    assert result["samples"] > 59_000_000


def test_the_simulated_board_is_the_one_that_is_measured():
    """The timed board is the ordinary one with a stop-watch."""
    assert issubclass(stream._TimedBoard, SimulatedDaq3500)
