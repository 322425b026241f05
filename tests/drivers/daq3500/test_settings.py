"""Tests of the digitizer's settings."""

from __future__ import annotations

import pytest

from drivers.errors import ConfigurationError


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"transfer_bytes": 1000}, "1000 bytes is no multiple of 512"),
        ({"transfer_bytes": 0}, "0 bytes"),
        ({"ring_seconds": 0.001}, "shorter than two transfers"),
        ({"ring_seconds": float("inf")}, "ring of inf s"),
        ({"sample_rate_hz": 1.1e6}, "more than 5 % off"),
        ({"sample_rate_hz": -1.0}, "-1.0 Hz"),
        ({"sample_rate_hz": float("nan")}, "nan Hz"),
        ({"sample_rate_u_hz": -1.0}, "u = -1.0 Hz"),
        ({"pacer_divisor": -1}, "divisor of -1"),
        ({"range_v": 7.0}, "7.0 V"),
    ],
)
def test_settings_that_describe_no_board_are_refused(make_settings, change, message):
    """The message names the value, at start-up rather than at the first drop."""
    with pytest.raises(ConfigurationError, match=message):
        make_settings(**change)


def test_the_ring_is_measured_in_calibrated_samples(make_settings):
    """Two seconds of the true rate."""
    assert make_settings(ring_seconds=2.0).ring_samples == 2 * 990_786
