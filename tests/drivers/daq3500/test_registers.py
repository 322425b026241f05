"""Tests of the bit patterns."""

from __future__ import annotations

import pytest

from drivers.daq3500.registers import RANGES_V, pacer_rate_hz, pacer_words, scan_entry
from drivers.errors import ConfigurationError

PLAIN = {"channel": 0, "range_v": 10.0, "differential": False, "settling_code": 0}


@pytest.mark.parametrize(
    ("change", "entry"),
    [
        ({}, 0x00000006),
        ({"channel": 5}, 0x00000056),
        ({"range_v": 0.1}, 0x06000006),
        ({"differential": True}, 0x00400006),
        ({"settling_code": 3}, 0x60000006),
        ({"channel": 15, "range_v": 1.0, "settling_code": 1}, 0x230000F6),
    ],
)
def test_scan_entries_are_the_documented_bits(change, entry):
    """Channel 0, +/-10 V, single-ended, last is 0x00000006; each field moves its own bits."""
    assert scan_entry(**(PLAIN | change)) == entry


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"channel": 16}, "no channel 16"),
        ({"channel": -1}, "no channel -1"),
        ({"channel": 8, "differential": True}, "no differential channel 8"),
        ({"range_v": 3.0}, r"no range of \+/-3.0 V"),
        ({"settling_code": 4}, "Settling code 4"),
    ],
)
def test_what_the_board_lacks_is_refused(change, message):
    """The message names the value and the choice."""
    with pytest.raises(ConfigurationError, match=message):
        scan_entry(**(PLAIN | change))


def test_a_divisor_of_47_is_one_megahertz():
    """f = 48 MHz / (N + 1)."""
    assert pacer_rate_hz(47) == 1.0e6


def test_the_divisor_is_split_into_three_words():
    """Low, middle, high, 16 bits each."""
    assert pacer_words(47) == (47, 0, 0)
    assert pacer_words(0x123456789ABC) == (0x9ABC, 0x5678, 0x1234)
    for wrong in (-1, 1 << 48):
        with pytest.raises(ConfigurationError):
            pacer_words(wrong)


def test_there_are_seven_ranges():
    """From 10 V down to 0.1 V, in the order of the gain code."""
    assert RANGES_V == (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1)
