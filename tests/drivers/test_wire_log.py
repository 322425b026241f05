"""Tests that a captured run can be played back to the driver."""

from __future__ import annotations

import json
import threading

import numpy as np
import pytest

from drivers.daq3500.device import Daq3500
from drivers.digitizer import TriggerSettings
from drivers.errors import DeviceLostError
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb_device import SimulatedDaq3500
from drivers.wire_log import CapturingBackend
from drivers.wire_replay import ReplayBackend, WireLogError

TRIGGER = TriggerSettings(
    level_v=0.5, hysteresis_v=0.2, pre_trigger_samples=2000, record_samples=6000
)


def _record(digitizer, fire=lambda: None):
    digitizer.ensure_ready()
    digitizer.arm(TRIGGER)
    fire()
    record = digitizer.wait_record(10.0, threading.Event())
    identity = digitizer.identity
    digitizer.close()
    return record, identity


@pytest.fixture
def captured(tmp_path, make_settings):
    """Return the log of a record on a board that had to be loaded, the record and the settings."""
    firmware, fpga = tmp_path / "firmware.bin", tmp_path / "fpga.bit"
    firmware.write_bytes(bytes(range(256)) * 5)
    fpga.write_bytes(b"fpga" * 1500)
    # A replay does not keep the time of the recording.
    settings = make_settings(firmware_file=firmware, fpga_file=fpga, pace_checked=False)
    source = PulseSource()
    backend = CapturingBackend(
        tmp_path / "wire.jsonl", SimulatedDaq3500(source, loaded=False), keep_data=True
    )
    record, identity = _record(Daq3500(settings, backend=backend), source.fire)
    backend.close()
    return backend.path, record, identity, settings


def test_a_captured_record_plays_back_to_the_last_sample(captured):
    """Open, load, arm, trigger, stop: the driver does the same on the log alone."""
    path, record, identity, settings = captured
    replay = ReplayBackend(path)
    again, who = _record(Daq3500(settings, backend=replay))
    replay.finish()
    np.testing.assert_array_equal(again.codes, record.codes)
    assert again.first_sample_index == record.first_sample_index
    assert again.status_words == record.status_words
    assert who == identity
    assert who.firmware_sha256 is not None


def test_a_deviation_fails_and_names_the_line(captured, make_settings):
    """A driver that sends another divisor is caught at that very transfer."""
    path, _, _, settings = captured
    changed = make_settings(
        firmware_file=settings.firmware_file,
        fpga_file=settings.fpga_file,
        pacer_divisor=48,
        pace_checked=False,
    )
    digitizer = Daq3500(changed, backend=ReplayBackend(path))
    with pytest.raises(WireLogError, match=r"Line \d+ of the log says control .* the driver did"):
        digitizer.ensure_ready()


def test_leftovers_fail(captured):
    """A driver that does less than the log is caught at the end."""
    path, _, _, settings = captured
    replay = ReplayBackend(path)
    digitizer = Daq3500(settings, backend=replay)
    digitizer.ensure_ready()
    with pytest.raises(WireLogError, match="were not replayed"):
        replay.finish()


def test_a_driver_that_goes_on_after_the_end_fails(captured):
    """The log does not invent answers."""
    path, _, _, settings = captured
    digitizer = Daq3500(settings, backend=ReplayBackend(path))
    _record(digitizer)
    with pytest.raises(WireLogError, match=r"has ended|has no|of the log says"):
        digitizer.ensure_ready()


def test_errors_of_the_wire_are_in_the_log_and_come_back(tmp_path, make_settings):
    """An unplugged board is unplugged in the replay too."""
    source = PulseSource()
    backend = CapturingBackend(tmp_path / "w.jsonl", SimulatedDaq3500(source), keep_data=True)
    digitizer = Daq3500(make_settings(), backend=backend)
    digitizer.ensure_ready()
    source.faults.usb_unplugged = True
    with pytest.raises(DeviceLostError):
        digitizer.sample_baseline(100)
    digitizer.close()
    backend.close()

    replayed = Daq3500(make_settings(), backend=ReplayBackend(backend.path))
    replayed.ensure_ready()
    with pytest.raises(DeviceLostError):
        replayed.sample_baseline(100)
    replayed.close()


def test_without_data_the_log_holds_length_and_hash(tmp_path, make_settings):
    """A log of a long run stays small, and says that it cannot be replayed."""
    path = tmp_path / "wire.jsonl"
    settings = make_settings(wire_log_file=path)
    digitizer = Daq3500(settings, backend=SimulatedDaq3500(PulseSource()))
    digitizer.ensure_ready()
    digitizer.close()
    entries = [json.loads(line) for line in path.read_text().splitlines()]
    bulk = [entry for entry in entries if entry["kind"] == "bulk_in" and "count" in entry]
    assert bulk
    assert all("in" not in entry and len(entry["sha256"]) == 64 for entry in bulk)
    with pytest.raises(WireLogError, match="without data"):
        ReplayBackend(path)


def test_an_older_log_is_never_overwritten(tmp_path):
    """The next log gets a number."""
    for name in ("wire.jsonl", "wire-1.jsonl"):
        backend = CapturingBackend(tmp_path / "wire.jsonl", SimulatedDaq3500(PulseSource()))
        backend.close()
        assert backend.path.name == name


@pytest.mark.parametrize("text", ["", "no json\n", '{"kind": "control"}\n', "[]\n"])
def test_a_file_that_is_no_log_is_refused(tmp_path, text):
    """With the reason, before anything is played."""
    path = tmp_path / "wire.jsonl"
    path.write_text(text)
    with pytest.raises(WireLogError):
        ReplayBackend(path)
