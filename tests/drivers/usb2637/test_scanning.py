"""Tests of a scan: what crosses the wire, every sample, overruns."""

from __future__ import annotations

import json
import threading
import time

import numpy as np
import pytest

from drivers.digitizer import TriggerSettings
from drivers.errors import ConfigurationError, OverrunError
from drivers.simulated.signal_sources import COUNT_PERIOD, CountingSource
from drivers.usb2637.settings import Usb2637Settings

from .conftest import RATE

TRIGGER = TriggerSettings(
    level_v=0.5, hysteresis_v=0.2, pre_trigger_samples=2000, record_samples=20_000
)


def test_a_run_crosses_the_wire_as_the_sources_say(make_bench, tmp_path):
    """Stop, clear; list of one channel; status; start; status after the samples; stop, clear."""
    log = tmp_path / "wire.jsonl"
    bench = make_bench(settings={"wire_log_file": log, "channel": 5})
    bench.digitizer.ensure_ready()
    bench.digitizer.sample_baseline(1000)
    bench.digitizer.close()
    entries = [json.loads(line) for line in log.read_text(encoding="utf-8").splitlines()]
    controls = [entry for entry in entries if entry["kind"] == "control"][-8:]
    # request type, request, value, index
    stop = [[0x40, 0x13, 0, 0], [0x40, 0x15, 0, 0]]
    assert [entry["setup"][:4] for entry in controls] == [
        *stop,
        [0x40, 0x14, 0, 0],
        [0xC0, 0x40, 0, 0],
        [0x40, 0x12, 0, 0],
        [0xC0, 0x40, 0, 0],
        *stop,
    ]
    assert bytes.fromhex(controls[2]["out"]) == bytes((5, *[0] * 63))
    # Count, retrigger count, divisor, samples a packet less one, options.
    start = "00000000 00000000 3f000000 ff 00"
    assert bytes.fromhex(controls[4]["out"]) == bytes.fromhex(start)


def test_every_sample_arrives_once_and_in_order(make_bench):
    """A count shows each loss."""
    bench = make_bench(CountingSource(), table=((1.0, 0.0),))
    bench.digitizer.ensure_ready()
    volts = bench.digitizer.sample_baseline(100_000)
    codes = np.rint(volts * 65536 / 20.0).astype(int) + 32768
    assert np.array_equal(codes, (codes[0] + np.arange(codes.size)) % COUNT_PERIOD)
    assert codes[0] == 0


def test_a_board_that_fell_silent_after_an_overrun_is_told_as_one(make_bench):
    """Its status is asked for, so that it is not taken for a board that hangs."""
    bench = make_bench(fifo_samples=300_000)
    bench.digitizer.ensure_ready()
    bench.digitizer.arm(TRIGGER)
    read = bench.board.converter.read_into

    def late(*arguments):
        time.sleep(1.0)  # 1 000 000 samples
        return read(*arguments)

    bench.board.converter.read_into = late
    with pytest.raises(OverrunError, match="scan overrun"):
        bench.digitizer.wait_record(5.0, threading.Event())
    bench.board.converter.read_into = read
    assert not bench.board.converter.running
    bench.digitizer.ensure_ready()
    bench.digitizer.sample_baseline(1000)


def test_an_overrun_behind_the_trigger_keeps_the_damaged_record(make_bench):
    """It is evidence, never a shot."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    bench.digitizer.arm(TRIGGER)
    bench.source.faults.overrun_at_sample = bench.source.fire() + 5000
    with pytest.raises(OverrunError) as caught:
        bench.digitizer.wait_record(5.0, threading.Event())
    assert caught.value.record is not None
    assert caught.value.record.trigger_index == TRIGGER.pre_trigger_samples


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"pacer_divisor": 62}, "from 2560 Hz to 1000000 Hz"),
        ({"pacer_divisor": 25_000}, "Set pacer_divisor to 63 for 1 MHz"),
        ({"pacer_divisor": 127}, "more than 5 % off"),
        ({"channel": 64}, "Set channel to 0 to 63"),
        ({"range_v": 5.0}, r"Set range_v to 10\.0"),
        ({"transfer_bytes": 1000}, "no multiple of 512"),
    ],
)
def test_settings_that_describe_no_board_are_refused(changes, words):
    """The message names what the board has."""
    with pytest.raises(ConfigurationError, match=words):
        Usb2637Settings(**(RATE | changes))


@pytest.mark.parametrize("divisor", [63, 127, 639, 24_999])
def test_each_rate_streams(make_bench, divisor):
    """Down to the slowest."""
    rate_hz = 64.0e6 / (divisor + 1)
    keys = {"pacer_divisor": divisor, "sample_rate_hz": rate_hz, "ring_seconds": 20.0}
    bench = make_bench(CountingSource(20.0), settings=keys | {"pace_checked": False})
    bench.digitizer.ensure_ready()
    assert bench.digitizer.sample_baseline(2000).size == 2000
