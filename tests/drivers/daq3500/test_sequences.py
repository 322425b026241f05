"""Tests that the wire carries the documented sequences, word by word."""

from __future__ import annotations

import json

import pytest

from drivers.daq3500.device import Daq3500
from drivers.simulated.signal_sources import PulseSource
from drivers.simulated.usb_device import SimulatedDaq3500

RESET = ["59=0000", "59=0010", "00=0030", "00=0010", "00=0003", "58=0010"]
SCAN_LIST = ["00=0004", "01=0006", "01=0000", "00=0054", "00=0040", "0f=0000"]
MARKS = [
    step for mark in ("fe", "02", "fb", "08", "ef", "20", "bf", "80")
    for step in (f"5d=00{mark}", "5d?")
]  # fmt: skip


def _step(entry):
    """Write a transfer short: ``register=value``, ``register?``, ``!request``, ``bulk``."""
    if entry["kind"] == "bulk_in":
        return "bulk"
    kind, request, value, index, _ = entry["setup"]
    if kind == 0x80:
        return "descriptor"
    if request != 0xB4:
        return f"!{request:02x}:{value:04x}:{index:x}"
    return f"{index:02x}={value:04x}" if kind == 0x40 else f"{index:02x}?"


@pytest.fixture
def steps(tmp_path, make_settings):
    """Return what crosses the wire when the board is opened and closed."""
    path = tmp_path / "wire.jsonl"
    board = SimulatedDaq3500(PulseSource())
    digitizer = Daq3500(make_settings(wire_log_file=path), backend=board)
    digitizer.ensure_ready()
    digitizer.close()
    entries = [json.loads(line) for line in path.read_text().splitlines()]
    shown = [_step(e) for e in entries if e["kind"] in ("control", "bulk_in")]
    # Runs of reads are as long as the machine is slow.
    return [s for i, s in enumerate(shown) if s != "bulk" or i == 0 or shown[i - 1] != "bulk"]


def test_opening_and_warm_up_follow_the_notes(steps):
    """Self-test, utility register, calibration, then one acquisition, started and stopped."""
    steps = [step for step in steps if step != "descriptor"]
    assert steps == [
        "!b0:0000:0",
        "!b2:0000:0",
        *MARKS,
        "07=0100",
        "07?",
        *RESET,
        "!b8:0000:0",
        "!b8:0140:0",
        "!b8:0280:0",
        *RESET,
        "bulk",
        *SCAN_LIST,
        "00?",
        "00=0060",
        "02=002f",
        "03=0000",
        "05=0000",
        "00=0003",
        "!bb:0001:2",
        "58=0011",
        "00=0071",
        "00=0011",
        "00?",
        "00=0031",
        "bulk",
        "00?",
        *RESET,
        "bulk",
    ]
