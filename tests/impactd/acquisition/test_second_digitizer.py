"""The service on the second digitizer: nothing above the driver knows which board it is."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from drivers.usb2637.device import Usb2637

from .conftest import Laboratory


def _keys(divisor: int) -> dict[str, Any]:
    rate_hz = 64.0e6 / (divisor + 1)
    return {
        "driver": "usb2637",
        "channel": 3,
        "pacer_divisor": divisor,
        "sample_rate_hz": rate_hz,
        "sample_rate_u_hz": 1e-5 * rate_hz,
    }


@pytest.mark.parametrize(("divisor", "rate_hz"), [(63, 1.0e6), (639, 0.1e6)])
def test_a_drop_becomes_a_stored_shot_at_each_rate(
    build: Callable[..., Laboratory], divisor: int, rate_hz: float
) -> None:
    """The shot says which board at which rate, has its volts, and is as long in seconds."""
    laboratory = build(digitizer=_keys(divisor)).start()
    assert isinstance(laboratory.rig.digitizer, Usb2637)
    drop = laboratory.drop()
    assert (drop.state, drop.problem) == ("stored", None)
    stored = laboratory.archive.read_shot(drop.number)
    metadata, recording = stored.metadata, stored.recording
    assert metadata.digitizer is not None
    assert metadata.digitizer.model == "MCC USB-2637"
    assert metadata.digitizer.note == "untested on a USB-2637"
    assert metadata.configuration["digitizer"]["driver"] == "usb2637"
    assert recording.sample_rate_hz == rate_hz
    assert recording.samples.size == round(0.4 * rate_hz)
    assert recording.trigger_index == round(0.020 * rate_hz)
    assert np.ptp(recording.signal) > 1.0


def test_both_boards_measure_the_same_impact(build: Callable[..., Laboratory]) -> None:
    """Same rig, same drop: each board's calibration table gives the same volts."""
    peaks_v = []
    for changes in ({}, {"digitizer": _keys(63)}):
        laboratory = build(**changes).start()
        stored = laboratory.archive.read_shot(laboratory.drop().number)
        peaks_v.append(float(np.max(stored.recording.signal)))
        laboratory.close()
    assert peaks_v[0] == pytest.approx(peaks_v[1], abs=0.01)


def test_an_overrun_stores_no_shot(build: Callable[..., Laboratory]) -> None:
    """A board that lost samples fails the drop, in words, and the next drop succeeds."""
    laboratory = build(digitizer=_keys(63)).start()
    laboratory.world.faults.overrun_at_sample = 30_000
    drop = laboratory.drop()
    assert drop.state != "stored"
    assert drop.problem is not None
    assert "Samples were lost" in str(drop.problem)
    assert laboratory.drop().state == "stored"
