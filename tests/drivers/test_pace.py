"""Counts against the clock, and blocks against themselves."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.pace import PACKET_SAMPLES, Pace, repeated_at

RATE_HZ = 1e6
TRANSFER = 8192


def _stream(lost_at: int | None = None, *, busy: range = range(0), late_s: float = 0.0) -> Pace:
    """Return the pace after 60 transfers with jitter, perhaps a lost packet and a busy stretch."""
    rng = np.random.default_rng(1)
    pace = Pace(RATE_HZ, 10.0)
    for n in range(1, 61):
        lost = PACKET_SAMPLES if lost_at is not None and n > lost_at else 0
        due_s = (n * TRANSFER + lost) / RATE_HZ
        jitter_s = float(rng.exponential(2e-5)) + (late_s if n in busy else 0.0)
        pace.arrived(n * TRANSFER, 100.0 + due_s + jitter_s)
    return pace


def test_a_whole_stream_is_on_time() -> None:
    """Small jitter and a busy stretch that is over are nothing."""
    assert _stream().on_time
    assert _stream(busy=range(10, 55), late_s=0.01).on_time


@pytest.mark.parametrize("lost_at", [5, 20, 59])
def test_a_lost_packet_is_late_for_ever(lost_at: int) -> None:
    """Wherever it was lost, the count lags behind the clock by its length."""
    pace = _stream(lost_at)
    assert not pace.on_time
    assert pace.late_samples == pytest.approx(PACKET_SAMPLES, abs=80)


def test_a_rate_within_its_uncertainty_is_no_loss() -> None:
    """Five sigma of a calibrated rate are allowed for."""
    pace = Pace(RATE_HZ, 1000.0)
    for n in range(1, 61):
        pace.arrived(n * TRANSFER, n * TRANSFER / (RATE_HZ - 2000.0))
    assert pace.on_time


@pytest.mark.parametrize("length", [PACKET_SAMPLES, TRANSFER])
@pytest.mark.parametrize("at", [0, 4321, 20_000])
def test_a_block_that_stands_twice_is_found(length: int, at: int) -> None:
    """Where the repetition begins."""
    codes = np.random.default_rng(2).integers(-3, 4, 40_000).astype(np.int16)
    doubled = np.concatenate([codes[: at + length], codes[at : at + length], codes[at + length :]])
    assert repeated_at(codes, length) is None
    found = repeated_at(doubled, length)
    assert found is not None
    # Of seven codes one neighbour in seven is equal by chance.
    assert 0 <= at + length - found <= 8


def test_a_clipped_or_silent_stretch_repeats_nothing() -> None:
    """One single code says nothing about blocks."""
    codes = np.full(5000, 32767, dtype=np.int16)
    assert repeated_at(codes, PACKET_SAMPLES) is None
    assert repeated_at(codes[:100], PACKET_SAMPLES) is None
