"""Tests of the digitizer as the daemon sees it, over the simulated transport."""

from __future__ import annotations

import math
import threading
import time

import numpy as np
import pytest

from drivers import stream_session
from drivers.digitizer import Digitizer, TriggerSettings
from drivers.errors import (
    AbortedError,
    ConfigurationError,
    DeviceBusyError,
    DeviceLostError,
    DeviceNotFoundError,
    DeviceTimeoutError,
    DriverError,
    OverrunError,
    ProtocolError,
    TriggerTimeoutError,
)
from drivers.simulated.world import World, WorldSettings
from drivers.usb_stream import SampleStream

TRIGGER = TriggerSettings(
    level_v=0.5, hysteresis_v=0.25, pre_trigger_samples=4000, record_samples=20_000
)
NEVER = threading.Event()


def _record(bench):
    bench.digitizer.arm(TRIGGER)
    at = bench.source.fire()
    return at, bench.digitizer.wait_record(10.0, NEVER)


def test_the_driver_is_a_digitizer(bench):
    """It has every method the daemon may call."""
    assert isinstance(bench.digitizer, Digitizer)


def test_a_record_holds_the_pulse_where_it_was(bench):
    """Position, pre-trigger part, length, rate and range are those of the settings."""
    at, record = _record(bench)
    assert record.codes.dtype == np.int16
    assert record.codes.size == 20_000
    assert record.trigger_index == 4000
    position = record.first_sample_index + record.trigger_index
    assert at < position < at + 20
    assert record.codes.max() > 7900
    assert record.codes[:3990].max() < 100
    assert record.sample_rate_hz == 990_786.0
    assert record.sample_rate_u_hz == 20.0
    assert record.range_v == 10.0
    assert record.calibrated
    assert record.samples_streamed >= record.first_sample_index + 20_000
    assert len(record.status_words) == 2


def test_a_falling_pulse_triggers_on_a_negative_level(bench):
    """The sign of the level gives the slope."""
    trigger = TriggerSettings(
        level_v=-0.5, hysteresis_v=0.25, pre_trigger_samples=4000, record_samples=8000
    )
    bench.digitizer.arm(trigger)
    bench.source.fire(peak_codes=-8000)
    record = bench.digitizer.wait_record(10.0, NEVER)
    assert record.codes.min() < -7900


def test_the_trigger_is_told_before_the_record_is_full(bench):
    """The acquisition shows "released, hit" while the ball still bounces."""
    bench.digitizer.arm(TRIGGER)
    before_ns = time.monotonic_ns()
    bench.source.fire()
    trigger_ns = bench.digitizer.wait_trigger(10.0, NEVER)
    assert before_ns < trigger_ns <= time.monotonic_ns()
    assert bench.digitizer.wait_record(10.0, NEVER).trigger_monotonic_ns == trigger_ns


def test_records_follow_one_another(bench):
    """Nothing of one run is left for the next."""
    for _ in range(3):
        _record(bench)
        bench.digitizer.sample_baseline(500)
    assert not bench.source.streaming


def test_what_a_stop_leaves_in_the_endpoint_is_drained(bench):
    """A run begins with its own first sample, not with the last run's."""
    bench.digitizer.arm(TRIGGER)
    bench.digitizer.ensure_stopped()
    at, record = _record(bench)
    # Stale packets would shift every position of this run.
    assert 0 < record.first_sample_index + record.trigger_index - at < 20


def test_no_impact_is_a_timeout_that_stops_the_converter(bench):
    """The message gives the waited time."""
    bench.digitizer.arm(TRIGGER)
    with pytest.raises(TriggerTimeoutError, match=r"within 0\.05 s"):
        bench.digitizer.wait_record(0.05, NEVER)
    assert not bench.board.converter.running


def test_an_abort_ends_the_wait_and_stops_the_converter(bench):
    """From any thread, within two transfers."""
    abort = threading.Event()
    bench.digitizer.arm(TRIGGER)
    threading.Timer(0.05, abort.set).start()
    with pytest.raises(AbortedError):
        bench.digitizer.wait_record(60.0, abort)
    assert not bench.board.converter.running


def test_closing_from_another_thread_ends_the_wait(bench):
    """The waiting thread hears of it."""
    bench.digitizer.arm(TRIGGER)
    threading.Timer(0.05, bench.digitizer.close).start()
    with pytest.raises(AbortedError):
        bench.digitizer.wait_trigger(60.0, NEVER)
    assert not bench.board.converter.running


def test_stopping_from_another_thread_ends_the_arming(make_bench):
    """An abort need not wait until the pre-trigger part is filled."""
    bench = make_bench(settings={"ring_seconds": 10.0})
    bench.digitizer.ensure_ready()
    threading.Timer(0.1, bench.digitizer.ensure_stopped).start()
    slow = TriggerSettings(
        level_v=0.5, hysteresis_v=0.2, pre_trigger_samples=8_000_000, record_samples=8_000_001
    )
    with pytest.raises(AbortedError):
        bench.digitizer.arm(slow)


def test_arming_twice_is_busy(bench):
    """One record at a time."""
    bench.digitizer.arm(TRIGGER)
    with pytest.raises(DeviceBusyError):
        bench.digitizer.arm(TRIGGER)
    with pytest.raises(DeviceBusyError):
        bench.digitizer.sample_baseline(100)


def test_waiting_without_arming_is_told(bench):
    """And not waited for."""
    with pytest.raises(AbortedError, match="No record is awaited"):
        bench.digitizer.wait_record(60.0, NEVER)


def test_nothing_works_before_it_is_ready(make_bench):
    """The message says which call is missing."""
    digitizer = make_bench().digitizer
    for call in (
        lambda: digitizer.identity,
        lambda: digitizer.arm(TRIGGER),
        lambda: digitizer.sample_baseline(10),
    ):
        with pytest.raises(DriverError, match="ensure_ready first"):
            call()
    digitizer.ensure_stopped()


@pytest.mark.parametrize("samples", [0, 10_000_000])
def test_a_record_must_fit_the_ring(bench, samples):
    """Refused before anything moves."""
    with pytest.raises(ConfigurationError, match="do not fit the ring"):
        bench.digitizer.sample_baseline(samples)


def test_a_level_out_of_range_is_refused_while_arming(bench):
    """The baseline is known only then."""
    trigger = TriggerSettings(
        level_v=11.0, hysteresis_v=0.2, pre_trigger_samples=1000, record_samples=2000
    )
    with pytest.raises(ConfigurationError, match="trigger level is at code"):
        bench.digitizer.arm(trigger)
    assert not bench.board.converter.running


def test_an_overrun_fails_the_record_and_keeps_it_as_evidence(bench):
    """Samples were lost somewhere: the record must not be used."""
    bench.digitizer.arm(TRIGGER)
    bench.source.faults.overrun_at_sample = bench.source.fire() + 3000
    with pytest.raises(OverrunError, match="results overrun") as caught:
        bench.digitizer.wait_record(10.0, NEVER)
    assert caught.value.record is not None
    assert caught.value.record.codes.size == 20_000
    assert not bench.board.converter.running


def test_an_overrun_fails_the_baseline_too(bench):
    """Noise with a hole in it is not the noise."""
    bench.source.faults.overrun_at_sample = 100
    with pytest.raises(OverrunError):
        bench.digitizer.sample_baseline(5000)


def test_a_fifo_that_is_too_short_for_the_host_is_an_overrun(make_bench):
    """What a gap between two reads does to a board with a finite FIFO."""
    bench = make_bench(fifo_samples=4096, settings={"transfer_bytes": 16384})
    with pytest.raises(OverrunError):
        bench.digitizer.ensure_ready()


def test_short_transfers_lose_nothing(bench):
    """A transfer that ends early is continued by the next one."""
    bench.source.faults.short_read = True
    at, record = _record(bench)
    assert 0 < record.first_sample_index + record.trigger_index - at < 20
    assert record.codes.size == 20_000


@pytest.mark.parametrize(
    ("fault", "error"), [("usb_unplugged", DeviceLostError), ("stall_endpoint", ProtocolError)]
)
def test_a_fault_while_waiting_ends_the_wait_at_once(bench, fault, error):
    """Unplugging and stalls are told apart, and long before the time-out."""
    bench.digitizer.arm(TRIGGER)
    threading.Timer(0.05, setattr, (bench.source.faults, fault, True)).start()
    started_s = time.monotonic()
    with pytest.raises(error):
        bench.digitizer.wait_record(60.0, NEVER)
    assert time.monotonic() - started_s < 10.0


@pytest.mark.parametrize("fault", ["usb_unplugged", "stall_endpoint"])
def test_after_a_fault_the_board_is_opened_again(bench, fault):
    """Plug it in, press ready, go on."""
    bench.digitizer.arm(TRIGGER)
    setattr(bench.source.faults, fault, True)
    with pytest.raises(DriverError):
        bench.digitizer.wait_record(10.0, NEVER)
    with pytest.raises((DeviceNotFoundError, ProtocolError)):
        bench.digitizer.ensure_ready()
    setattr(bench.source.faults, fault, False)
    bench.digitizer.ensure_ready()
    _record(bench)


def test_a_start_that_failed_gives_the_board_back(make_bench, monkeypatch):
    """On a starved host the stream outlived its start and claimed the board again, for ever."""
    bench = make_bench()
    joins = []

    def join_late(stream, timeout_s):
        joins.append(stream)
        return False

    monkeypatch.setattr(stream_session, "_START_LIMIT_S", -1.0)
    monkeypatch.setattr(SampleStream, "join", join_late)
    with pytest.raises(DeviceTimeoutError):
        bench.digitizer.ensure_ready()
    monkeypatch.undo()
    assert joins[0].join(60.0)
    assert bench.board._plugged.claimed_by is None, "what outlived the start claimed the board"
    bench.digitizer.ensure_ready()
    _record(bench)


def test_unplugging_at_a_planned_time_is_noticed(make_bench):
    """The simulated rig can pull the plug by its own clock."""
    bench = make_bench()
    bench.digitizer.ensure_ready()
    bench.source.faults.unplug_usb_at_s = bench.source.clock.now_s() + 0.1
    bench.digitizer.arm(TRIGGER)
    with pytest.raises(DeviceLostError):
        bench.digitizer.wait_record(10.0, NEVER)


def test_an_uncalibrated_board_gives_nominal_volts_and_says_so(make_bench):
    """Nothing is corrected by a table that was rejected."""
    bench = make_bench(eeprom=bytes(808))
    bench.digitizer.ensure_ready()
    _, record = _record(bench)
    assert not record.calibrated
    assert record.volts_per_code == 20.0 / 65536
    assert record.offset_v == 0.0


def test_everything_may_be_called_again_after_the_end(bench):
    """Stop twice, close twice, open again."""
    bench.digitizer.ensure_stopped()
    bench.digitizer.ensure_stopped()
    bench.digitizer.close()
    bench.digitizer.close()
    bench.digitizer.ensure_ready()
    bench.digitizer.ensure_ready()
    _record(bench)


def test_ready_twice_is_free(bench):
    """A ready board is not opened again: its converter is not started."""
    runs = bench.source.streams_started
    bench.digitizer.ensure_ready()
    assert bench.source.streams_started == runs


def test_many_threads_stop_at_once(bench):
    """Whoever pulls first, nobody hangs and the converter stands."""
    bench.digitizer.arm(TRIGGER)
    errors = []

    def wait() -> None:
        try:
            bench.digitizer.wait_record(60.0, NEVER)
        except AbortedError:
            pass
        except BaseException as error:
            errors.append(error)

    threads = [threading.Thread(target=wait)]
    threads += [threading.Thread(target=bench.digitizer.ensure_stopped) for _ in range(6)]
    threads += [threading.Thread(target=bench.digitizer.close) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
        assert not thread.is_alive()
    assert not errors
    assert not bench.board.converter.running


@pytest.mark.parametrize("clock_speed", [1.0, 20.0, math.inf])
def test_a_drop_of_the_simulated_world_is_recorded(make_bench, clock_speed):
    """At any speed of the rig's clock, the impact is where the record says."""
    world = World(WorldSettings(clock_speed=clock_speed))
    bench = make_bench(world)
    bench.digitizer.ensure_ready()
    sphere, surface = next(iter(world.settings.spheres)), next(iter(world.settings.surfaces))
    world.load(sphere, surface, 0.047)
    trigger = TriggerSettings(
        level_v=0.2, hysteresis_v=0.1, pre_trigger_samples=20_000, record_samples=200_000
    )
    bench.digitizer.arm(trigger)
    world.set_vacuum(False)
    record = bench.digitizer.wait_record(20.0, NEVER)
    volts = record.codes * record.volts_per_code + record.offset_v
    assert volts[:19_900].std() < 0.05
    assert volts[20_000:20_500].max() > 0.2
