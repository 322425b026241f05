"""Drift is taken off quiet stretches, and what noise leaves in them is known."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.quiet_spectrum import (
    LONGEST,
    LOWEST,
    drift_degree,
    pieces_of,
    pooled_spectrum,
    slow_covariance,
    without_drift,
)

RATE_HZ = 1e6


def _hum(samples: int, seed: int, volts: float = 0.1) -> np.ndarray:
    """Hum of 60 Hz with its odd harmonics up to the seventh."""
    t = np.random.default_rng(seed).uniform(0, 1e3) + np.arange(samples) / RATE_HZ
    return volts * sum(np.sin(2 * np.pi * 60 * n * t + n) / n for n in (1, 3, 5, 7))


def _rising(samples: int, rng: np.random.Generator, slope: int) -> np.ndarray:
    """Noise of density 1/f^slope (cycles per sample), by lines of a far longer record."""
    n = 1 << 16
    f = np.fft.rfftfreq(n)
    shape = np.sqrt(np.concatenate([[0.0], 1 / f[1:] ** slope]))
    return np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) * shape, n)[:samples]


@pytest.mark.parametrize("samples", [400, 1500, 10_000])
def test_hum_is_taken_off_whole(samples: int) -> None:
    """A tenth of a volt of hum leaves less than a converter step, in short and long stretches."""
    left = without_drift(_hum(samples, 3), drift_degree(samples, RATE_HZ))
    assert np.abs(left).max() < 1e-4


@pytest.mark.parametrize("slope", [1, 2])
def test_covariance_of_rising_noise_is_the_sum_of_its_lines(slope: int) -> None:
    """The closed form agrees with a fine sum over frequency, the flat bottom included."""
    edges = np.concatenate([np.linspace(0, LOWEST, 50), np.geomspace(LOWEST, 0.5, 400_001)[1:]])
    f, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    density = 1 / np.maximum(f, LOWEST) ** slope
    found = slow_covariance(500, slope)
    for lag in (0, 1, 7, 500):
        wanted = 2 * np.sum(density * np.cos(2 * np.pi * f * lag) * width)
        assert found[lag] == pytest.approx(wanted, rel=1e-6, abs=1e-4)


@pytest.mark.parametrize("slope", [1, 2])
def test_powers_are_as_expected_for_white_and_for_rising_noise(slope: int) -> None:
    """Line by line, white noise has the white expectation and rising noise that of its slope."""
    rng = np.random.default_rng(5)
    white = pooled_spectrum([rng.standard_normal(1000) for _ in range(300)], RATE_HZ)
    slow = pooled_spectrum([_rising(1000, rng, slope) for _ in range(1000)], RATE_HZ, slope)
    assert white is not None
    assert slow is not None
    for ratio, seen in ((white.power / white.white, white), (slow.power / slow.slow, slow)):
        spread = np.sqrt(2 / (seen.pieces * seen.lines))
        assert np.mean(((ratio - 1) / spread) ** 2) == pytest.approx(1.0, abs=0.35)
    assert white.drift == pytest.approx(white.drift_white, rel=0.1)
    assert slow.drift == pytest.approx(slow.drift_slow, rel=0.15)


def test_hum_is_seen_as_drift_and_not_as_power() -> None:
    """With hum the powers stay those of white noise; the drift is far beyond what noise makes."""
    rng = np.random.default_rng(6)
    seen = pooled_spectrum(
        [1e-3 * rng.standard_normal(1500) + _hum(1500, k) for k in range(50)], RATE_HZ
    )
    assert seen is not None
    level = np.average(seen.power / seen.white, weights=seen.lines)
    assert level == pytest.approx(1e-6, rel=0.03)
    assert seen.drift > 1e3 * level * seen.drift_white


def test_stretches_of_different_length_share_one_piece_length() -> None:
    """A stretch far shorter than the others is left out; a long one gives several pieces."""
    rng = np.random.default_rng(7)
    sizes = [1000] * 5 + [300] + [2100]
    seen = pooled_spectrum([rng.standard_normal(n) for n in sizes], RATE_HZ)
    assert seen is not None
    assert (seen.samples, seen.pieces) == (1000, 7)


def test_a_long_stretch_is_looked_at_in_pieces() -> None:
    """Tenths of a second of it: all samples but a rest shorter than a piece."""
    stretch = np.arange(130_000.0)
    pieces = pieces_of(stretch, RATE_HZ)
    assert {piece.size for piece in pieces} == {LONGEST}
    np.testing.assert_array_equal(np.concatenate(pieces), stretch[130_000 % LONGEST :])
    (whole,) = pieces_of(stretch[:20_000], RATE_HZ)
    assert whole.size == 20_000


def test_short_stretches_say_nothing() -> None:
    """Where drift and 1/f cannot be told apart nothing is claimed."""
    assert pooled_spectrum([np.ones(100)], RATE_HZ) is None
    assert pooled_spectrum([], RATE_HZ) is None
