"""Tests of the way from blocks to a record."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.digitizer import TriggerSettings
from drivers.ring_buffer import RingBuffer
from drivers.triggered_capture import MINIMUM_BASELINE_SAMPLES, Collector, TriggeredCapture
from drivers.usb_stream import Progress

TRIGGER = TriggerSettings(
    level_v=0.1, hysteresis_v=0.05, pre_trigger_samples=2000, record_samples=5000
)
VOLTS_PER_CODE = 1e-3


def _run(consumer, codes, block_size):
    ring = RingBuffer(20_000)
    seen = []
    for at in range(0, codes.size, block_size):
        block = codes[at : at + block_size]
        first = ring.append(block)
        seen.append(consumer.take(block, first, ring))
        if seen[-1] is Progress.DONE:
            break
    return seen


def _codes(pulse_at, size=12_000, peak=300):
    codes = np.full(size, 30_000, dtype=np.uint16)
    codes[pulse_at : pulse_at + 50] += np.uint16(peak)
    return codes


@pytest.mark.parametrize("block_size", [1, 7, 256, 1999, 2000, 2001, 12_000])
def test_the_record_has_the_trigger_where_it_was_asked_for(block_size):
    """The block size of the transport leaves no mark in the record."""
    capture = TriggeredCapture(TRIGGER, VOLTS_PER_CODE)
    codes = _codes(4321)
    seen = _run(capture, codes, block_size)
    assert seen[-1] is Progress.DONE
    assert capture.trigger_position == 4321
    np.testing.assert_array_equal(capture.codes, codes[2321:7321])


def test_a_pulse_inside_the_fill_time_is_no_trigger():
    """Before the pre-trigger part is filled nothing can trigger."""
    capture = TriggeredCapture(TRIGGER, VOLTS_PER_CODE)
    _run(capture, _codes(1500), 256)
    assert capture.armed
    assert not capture.triggered
    assert not capture.complete


def test_the_level_counts_from_the_baseline():
    """An offset at the input moves the trigger with it."""
    low = TriggeredCapture(TRIGGER, VOLTS_PER_CODE)
    _run(low, _codes(4321, peak=99), 256)
    assert not low.triggered
    high = TriggeredCapture(TRIGGER, VOLTS_PER_CODE)
    _run(high, _codes(4321, peak=100), 256)
    assert high.triggered


def test_the_baseline_never_rests_on_a_handful_of_samples():
    """Without a pre-trigger part the baseline still gets its samples."""
    trigger = TriggerSettings(
        level_v=0.1, hysteresis_v=0.05, pre_trigger_samples=0, record_samples=100
    )
    capture = TriggeredCapture(trigger, VOLTS_PER_CODE)
    codes = _codes(MINIMUM_BASELINE_SAMPLES + 10)
    _run(capture, codes, 64)
    assert capture.first_position == MINIMUM_BASELINE_SAMPLES + 10
    assert capture.codes is not None
    assert capture.codes.size == 100


def test_progress_is_told_once_per_change():
    """A waiting thread is woken by arming, trigger and end only."""
    capture = TriggeredCapture(TRIGGER, VOLTS_PER_CODE)
    seen = _run(capture, _codes(4321), 100)
    assert seen.count(Progress.CHANGED) == 2
    assert seen.count(Progress.DONE) == 1


def test_a_collector_takes_the_first_samples():
    """What was asked for, and not one more."""
    collector = Collector(300)
    codes = np.arange(1000, dtype=np.uint16)
    seen = _run(collector, codes, 128)
    assert seen[-1] is Progress.DONE
    np.testing.assert_array_equal(collector.codes, codes[:300])


def test_the_first_position_is_unknown_before_the_trigger():
    """Asking too early is a mistake of the caller."""
    with pytest.raises(ValueError, match="no trigger"):
        _ = TriggeredCapture(TRIGGER, VOLTS_PER_CODE).first_position
