"""Tests of the calibration table."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from drivers.daq3500.calibration import range_calibration
from drivers.simulated.usb_eeprom import BoardErrors
from drivers.simulated.world import World, WorldSettings

HEADER = bytes.fromhex("40010001")


def _table(rows=((0.001, 0.003, 0.01),) * 7, header=HEADER):
    return header + b"".join(struct.pack("<fff", *row) for row in rows)


def test_the_gain_is_one_plus_the_mean_of_two_coefficients():
    """V = gain * Vraw + offset, worked by hand for +/-5 V."""
    rows = [(0.0, 0.0, 0.0)] * 7
    rows[1] = (0.001, 0.003, 0.01)
    calibration = range_calibration(_table(rows), 5.0)
    assert calibration.calibrated
    assert calibration.volts_per_code == pytest.approx(1.002 * 10.0 / 65536, rel=1e-7)
    assert calibration.offset_v == pytest.approx(0.01, rel=1e-7)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        (_table(header=bytes.fromhex("40010002")), "its header reads 40 01 00 02"),
        (b"\xff" * 808, "its header reads ff ff ff ff"),
        (b"", "its header reads nothing"),
        (_table()[:80], "its header"),
        (_table(((0.0, 0.11, 0.0),) * 7), "coefficient of 0.11 is beyond 0.1"),
        (_table(((0.0, 0.0, -0.2),) * 7), "coefficient of -0.2"),
        (_table(((float("nan"), 0.0, 0.0),) * 7), "coefficient of nan"),
        (_table((*(((0.0, 0.0, 0.0),) * 6), (0.5, 0.0, 0.0))), "coefficient of 0.5"),
    ],
)
def test_a_doubtful_table_corrects_nothing_and_says_why(table, reason):
    """Another range's bad coefficient also condemns the table."""
    calibration = range_calibration(table, 10.0)
    assert not calibration.calibrated
    assert reason in calibration.reason
    assert calibration.volts_per_code == 20.0 / 65536
    assert calibration.offset_v == 0.0


@pytest.mark.parametrize("range_v", [10.0, 5.0, 2.0])
def test_calibration_undoes_what_the_simulated_board_does(make_bench, range_v):
    """A known voltage at the input is what comes out; without calibration it would not."""
    world = World(WorldSettings(offset_v=1.5))
    bench = make_bench(world, settings={"range_v": range_v})
    bench.digitizer.ensure_ready()
    step_v = 2 * range_v / 65536
    found_v = np.median(bench.digitizer.sample_baseline(20_000))
    assert abs(found_v - 1.5) < 1.01 * step_v
    errors = BoardErrors()
    index = (10.0, 5.0, 2.0).index(range_v)
    raw_v = (1.5 - errors.offset_v[index]) / errors.gain(index)
    assert abs(raw_v - 1.5) > 2 * step_v
