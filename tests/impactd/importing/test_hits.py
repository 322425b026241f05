"""Hits in long records are found whatever their rate, size, sign and neighbours."""

from __future__ import annotations

import numpy as np
import pytest

from impactd.importing.hits import LEAST_QUIET, find_hits
from tests.impactd.importing.conftest import make_record


@pytest.mark.parametrize("contact", [6, 60, 600])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_hit_is_found_where_it_begins(contact: int, sign: float) -> None:
    """Three hits of different size, up or down, at any number of samples in the contact."""
    begins = tuple(contact * k for k in (60, 200, 370))
    made = make_record(begins, samples=500 * contact, contact=contact)
    found = find_hits(sign * made.signal + 7.0)
    assert [hit.impacts for hit in found.hits] == [1, 1, 1]
    for hit, begin in zip(found.hits, begins, strict=True):
        assert begin - 2 <= hit.touch <= begin + 0.2 * contact
        assert hit.touch - hit.first >= min(64, 10 * contact)
        assert hit.contact == pytest.approx(contact, rel=0.35, abs=2)
        assert np.sign(hit.peak) == sign
    stops = [hit.stop for hit in found.hits]
    assert all(hit.first >= stop for hit, stop in zip(found.hits[1:], stops, strict=False))


def test_two_blows_without_quiet_between_them_stay_together() -> None:
    """A hammer that bounced makes one shot of two impacts; the hit after it stays its own."""
    made = make_record((4000, 4300, 20_000), peaks=(100.0, 50.0, 80.0))
    found = find_hits(made.signal)
    assert [hit.impacts for hit in found.hits] == [2, 1]
    assert found.hits[0].stop > 4300 + made.contact


def test_ringing_is_no_second_blow() -> None:
    """A structure that rings and beats for a long time was hit once."""
    made = make_record((4000,))
    ring = np.arange(12_000)
    beat = 15.0 * np.exp(-ring / 4000) * np.sin(ring / 3) * np.cos(ring / 200)
    signal = made.signal.copy()
    signal[4060:16_060] += beat
    (hit,) = find_hits(signal).hits
    assert hit.impacts == 1


def test_noise_alone_is_no_hit() -> None:
    """Of five hundred records of noise half a one is expected to have a hit."""
    random = np.random.default_rng(11)
    assert sum(bool(find_hits(random.normal(size=20_000)).hits) for _ in range(500)) <= 3


def test_hum_and_a_moving_zero_line_are_no_hits() -> None:
    """Mains hum of a fiftieth of the peak and a drift of as much change nothing."""
    made = make_record()
    place = np.arange(made.signal.size)
    signal = made.signal + 2.0 * np.sin(place * 2 * np.pi / 1000) + 2.0 * place / place.size
    assert len(find_hits(signal).hits) == 3


def test_a_hit_that_the_record_begins_in_is_left_out() -> None:
    """Without a quiet start there is no baseline to judge it by."""
    made = make_record((2, 14_000))
    found = find_hits(made.signal)
    assert found.begun == 1
    (hit,) = found.hits
    assert hit.touch >= 14_000 - LEAST_QUIET


def test_a_triggered_record_is_kept_whole() -> None:
    """What an instrument cut already is not cut again."""
    made = make_record((400,), samples=2500)
    (hit,) = find_hits(made.signal).hits
    assert (hit.first, hit.stop) == (0, 2500)


def test_a_coarse_converter_makes_no_hits() -> None:
    """A quiet part of one code has no noise; a step of the converter counts as it."""
    made = make_record(noise=0.0)
    coarse = np.round(made.signal)
    coarse[::997] += 1.0
    assert len(find_hits(coarse, step=1.0).hits) == 3
