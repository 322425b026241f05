"""Counts against the clock, and blocks against themselves."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.digitizer import Record
from drivers.errors import OverrunError
from drivers.pace import (
    BEGINNING_SAMPLES,
    PACKET_SAMPLES,
    Latency,
    Pace,
    check_pace,
    repeated_at,
)

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


def _started(
    delay_s: float, *, lost: int = 0, runs: int = 1, latency: Latency | None = None
) -> Pace:
    """Return the pace of the last of some runs whose every transfer comes so late, from the start.

    Only the last run loses anything, at once behind its beginning.
    """
    latency = latency or Latency()
    for run in range(1, runs + 1):
        pace = Pace(RATE_HZ, 10.0, latency)
        assert pace.started(100.0, 100.00002)
        for n in range(512, 200_000, 512):
            gone = lost if run == runs and n > BEGINNING_SAMPLES else 0
            pace.arrived(n, 100.0 + (n + gone) / RATE_HZ + delay_s)
    return pace


@pytest.mark.parametrize("delay_s", [0.0, 5e-5, 2e-4])
def test_what_comes_within_a_packet_of_the_start_is_whole(delay_s: float) -> None:
    """However late the host is, a transfer that is in time has nothing missing before it."""
    assert _started(delay_s).on_time
    assert not _started(delay_s, lost=PACKET_SAMPLES).on_time


def test_no_delays_whatever_hide_a_gap() -> None:
    """Any host, any place, any rate within its five sigma: behind a gap nothing counts as whole."""
    rng = np.random.default_rng(7)
    proved = 0
    for _ in range(500):
        transfers = int(rng.integers(2, 300))
        pace = Pace(RATE_HZ, 10.0)
        pace.started(100.0, 100.0 + 5e-5)
        began_s, true_hz = 100.0 + rng.uniform(0.0, 5e-5), RATE_HZ + rng.uniform(-50.0, 50.0)
        counts = np.cumsum(rng.integers(1, 17, transfers)) * PACKET_SAMPLES
        late_s = rng.exponential(10.0 ** rng.uniform(-6.0, -2.0), transfers)
        lost_at, lost = rng.integers(0, transfers), rng.integers(1, 40) * PACKET_SAMPLES
        for n, (count, delay_s) in enumerate(zip(counts, late_s, strict=True)):
            gone = lost if n >= lost_at else 0
            pace.arrived(int(count), began_s + (count + gone) / true_hz + delay_s)
            assert not (gone and pace.on_time)
            proved += pace.on_time
    assert proved > 10_000, "before the gap most transfers prove what came so far"


def test_a_host_that_is_late_all_the_time_never_hides_a_gap() -> None:
    """It cannot prove a record whole, and then none is taken for whole."""
    busy = Latency()
    assert not _started(5e-3, latency=busy).on_time
    assert not _started(3e-4, lost=PACKET_SAMPLES, latency=busy).on_time
    assert _started(1e-4, latency=busy).on_time
    assert not _started(1e-4, lost=PACKET_SAMPLES, latency=busy).on_time


def test_a_board_that_is_slow_by_nature_is_learned() -> None:
    """After a few runs its own latency is what the others are held against."""
    assert not _started(4e-4).on_time
    assert _started(4e-4, runs=5).on_time
    assert not _started(4e-4, lost=PACKET_SAMPLES, runs=5).on_time


def test_a_host_that_was_busy_while_it_was_learned_hides_no_gap() -> None:
    """Its long delays stand for the board's; once it is less busy, a run's own show them up."""
    _started(6e-4, runs=4, latency=(learned_while_busy := Latency()))
    pace = Pace(RATE_HZ, 10.0, learned_while_busy)
    pace.started(100.0, 100.00002)
    for n in range(512, 200_000, 512):
        gone = PACKET_SAMPLES if n > 150_000 else 0
        delay_s = 6e-4 if n < 2 * BEGINNING_SAMPLES else 2e-4
        pace.arrived(n, 100.0 + (n + gone) / RATE_HZ + delay_s)
        assert pace.on_time == (not gone)


def test_an_interrupted_start_is_worth_another() -> None:
    """A command that took longer than usual leaves the beginning in doubt."""
    pace = Pace(RATE_HZ, 10.0, latency := Latency())
    assert pace.started(100.0, 100.00005)
    assert not pace.started(100.0, 100.002)
    assert pace.started(100.0, 100.00009)
    assert latency.start_s == pytest.approx(5e-5, rel=1e-6)


def test_a_rate_known_too_poorly_is_told_as_the_reason() -> None:
    """Behind half a second 100 ppm may be a packet: neither loss nor busy host is to blame."""
    pace = Pace(RATE_HZ, 100.0)
    pace.started(100.0, 100.00002)
    for n in range(512, 700_000, 512):
        pace.arrived(n, 100.0 + n / RATE_HZ + 2e-5)
    assert not pace.on_time
    codes = np.zeros(9, np.int16)
    record = Record(codes, 1.0, 0.0, True, RATE_HZ, 100.0, 10.0, 4, 0, 0)
    with pytest.raises(OverrunError, match=r"only 0\.51 s can be proved") as caught:
        check_pace(pace, record)
    assert "sample_rate_u_hz" in caught.value.remedy


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
