"""Tests of the calibration from the board's EEPROM."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from drivers.simulated.world import World, WorldSettings
from drivers.usb2637.calibration import range_calibration

STEP_V = 20.0 / 65536


@pytest.mark.parametrize(
    ("slope", "offset", "code", "volts"),
    [
        (1.0, 0.0, 32768, 0.0),
        (1.0, 0.0, 65535, 10.0 - STEP_V),
        (1.0, 10.0, 32768, 10.0 * STEP_V),
        (1.01, -300.0, 0, -10.0 - 300.0 * STEP_V),
        (1.01, -300.0, 40000, (1.01 * 40000 - 300.0 - 32768.0) * STEP_V),
    ],
)
def test_a_code_becomes_volts_as_the_maker_does_it(slope, offset, code, volts):
    """The table corrects offset-binary codes; the record has signed ones."""
    calibration = range_calibration(struct.pack("<ff", slope, offset))
    assert calibration.calibrated
    got = (code - 32768) * calibration.volts_per_code + calibration.offset_v
    assert got == pytest.approx(volts, abs=1e-5)


@pytest.mark.parametrize(
    "row", [(0.0, 0.0), (2.0, 0.0), (float("nan"), 0.0), (1.0, 2e4), (1.0, float("nan"))]
)
def test_a_doubtful_table_corrects_nothing(row):
    """It is marked, and says why."""
    calibration = range_calibration(struct.pack("<ff", *row))
    assert not calibration.calibrated
    assert (calibration.volts_per_code, calibration.offset_v) == (STEP_V, 0.0)
    assert "slope" in calibration.reason


@pytest.mark.parametrize("table", [((1.0, 0.0),), ((1.05, -1500.0),), ((0.95, 2000.0),)])
def test_the_table_of_the_board_takes_its_errors_away(make_bench, table):
    """A board that is off by volts measures a resting input right."""
    world = World(WorldSettings(offset_v=0.5))
    bench = make_bench(world, table=table)
    bench.digitizer.ensure_ready()
    assert np.median(bench.digitizer.sample_baseline(10_000)) == pytest.approx(0.5, abs=5e-4)


def test_a_rejected_table_is_told_in_the_identity(make_bench):
    """Whoever reads the shot sees that it is uncalibrated."""
    bench = make_bench(stated=((float("nan"), 0.0),))
    bench.digitizer.ensure_ready()
    assert "uncalibrated" in bench.digitizer.identity.note
