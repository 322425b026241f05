"""Tests of what the status words let pass."""

from __future__ import annotations

import pytest

from drivers.daq3500.registers import ERRORS, OVERRUNS
from drivers.errors import OverrunError, RecordError
from drivers.stream_status import check_status

BITS = {"overruns": OVERRUNS, "faults": ERRORS}


@pytest.mark.parametrize("status", [0x0000, 0x000B, 0x0020, 0x0010, 0x0200])
def test_ordinary_bits_pass(status):
    """Data, scanning and the analog outputs' bits say nothing against a record."""
    check_status((0x0004, status), **BITS)


@pytest.mark.parametrize(("status", "name"), [(0x0004, "results overrun"), (0x0100, "adc pacer")])
def test_lost_samples_fail_the_record(status, name):
    """Both overruns are told apart by name."""
    with pytest.raises(OverrunError, match=name):
        check_status((0, status | 0x000B), **BITS)


@pytest.mark.parametrize(("status", "name"), [(0x0040, "adc not ready"), (0x0080, "arbitration")])
def test_faults_of_the_converter_fail_the_record(status, name):
    """They are no overrun, and no record either."""
    with pytest.raises(RecordError, match=name) as caught:
        check_status((0, status), **BITS)
    assert not isinstance(caught.value, OverrunError)


@pytest.mark.parametrize("words", [(), (0,)])
def test_a_run_without_its_closing_word_fails(words):
    """What was not asked cannot be trusted."""
    with pytest.raises(RecordError, match="closing status"):
        check_status(words, **BITS)
