"""Tests of the software trigger."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from drivers.digitizer import TriggerSettings
from drivers.errors import ConfigurationError
from drivers.trigger import LevelTrigger, check_trigger


def _by_hand(codes, level, hysteresis):
    """Look at one sample after the other, as the definition says."""
    armed = False
    for index, code in enumerate(codes):
        value = float(code) - 100.0
        sign = 1.0 if level > 0 else -1.0
        if not armed:
            armed = sign * value < sign * (level - sign * hysteresis)
        if armed and sign * value >= sign * level:
            return index
    return None


@given(
    codes=hnp.arrays(np.uint16, st.integers(0, 60), elements=st.integers(80, 120)),
    level=st.integers(-15, 15).filter(bool),
    share=st.floats(0.0, 1.0),
    cuts=st.lists(st.integers(0, 60), max_size=5),
)
@settings(max_examples=400, deadline=None)
def test_blocks_give_the_same_trigger_as_the_definition(codes, level, share, cuts):
    """However a stream is cut into blocks, the trigger is the one of the definition."""
    hysteresis = share * abs(level)
    trigger = LevelTrigger(100.0, level, hysteresis)
    found, at = None, 0
    for block in np.split(codes, sorted(min(cut, codes.size) for cut in cuts)):
        hit = trigger.search(block)
        if hit is not None:
            found = at + hit
            break
        at += block.size
    assert found == _by_hand(codes, level, hysteresis)


def test_a_signal_that_starts_beyond_the_level_does_not_trigger():
    """The signal must have been away from the level before."""
    trigger = LevelTrigger(100.0, 50.0, 25.0)
    assert trigger.search(np.full(10, 200, dtype=np.uint16)) is None
    assert trigger.search(np.array([124, 150], dtype=np.uint16)) == 1


@pytest.mark.parametrize(("baseline", "level"), [(60000.0, 6000.0), (3000.0, -4000.0)])
def test_a_level_no_code_can_reach_is_refused(baseline, level):
    """A trigger that could never fire is a mistake, not a patient wait."""
    with pytest.raises(ConfigurationError, match="trigger level is at code"):
        LevelTrigger(baseline, level, 10.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"level_v": 0.0}, "level of 0.0 V"),
        ({"level_v": float("nan")}, "level of nan V"),
        ({"hysteresis_v": -0.1}, "hysteresis of -0.1 V"),
        ({"hysteresis_v": 0.6}, "hysteresis of 0.6 V"),
        ({"pre_trigger_samples": -1}, "-1 samples before"),
        ({"pre_trigger_samples": 1000}, "1000 samples before"),
    ],
)
def test_impossible_settings_are_refused_with_their_value(change, message):
    """The message names what cannot be."""
    values = {
        "level_v": 0.5,
        "hysteresis_v": 0.2,
        "pre_trigger_samples": 100,
        "record_samples": 1000,
    }
    check_trigger(TriggerSettings(**values))
    with pytest.raises(ConfigurationError, match=message):
        check_trigger(TriggerSettings(**(values | change)))
