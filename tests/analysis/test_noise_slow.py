"""Noise that rises slowly is told from white and correlated noise and from hum, and whitened."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.noise import SLOW_PRICE, NoiseModel, estimate_noise
from analysis.noise_slow import (
    Slow,
    autoregressive,
    promised_gain,
    whitening_filter,
    with_slow_part,
)
from analysis.quiet_spectrum import pooled_spectrum

RATE_HZ = 1e6
RMS_V = 1.5e-3


def _record(
    rng: np.random.Generator, samples: int, *, corner_hz: float, rho: float, slope: int = 1
) -> np.ndarray:
    """White or AR(1) noise with a part of 1/f^slope, by lines of a longer record."""
    n = 1 << 16
    f = np.fft.rfftfreq(n)
    power = (1 - rho**2) / np.abs(1 - rho * np.exp(-2j * np.pi * f)) ** 2
    power[1:] += (corner_hz / (f[1:] * RATE_HZ)) ** slope
    shaped = np.fft.rfft(rng.standard_normal(n)) * np.sqrt(power)
    return RMS_V * np.fft.irfft(shaped, n)[:samples]


def _hum(rng: np.random.Generator, samples: int) -> np.ndarray:
    t = rng.uniform(0, 1e3) + np.arange(samples) / RATE_HZ
    return 0.03 * (np.sin(100 * np.pi * t) + np.sin(300 * np.pi * t + 1) / 3)


def _estimate(
    seed: int, *, corner_hz: float, rho: float = 0.0, hum: bool = False, slope: int = 1
) -> NoiseModel:
    """The model of a campaign's quiet stretches: 54 of 1490 samples."""
    rng = np.random.default_rng(seed)
    quiet = [_record(rng, 1490, corner_hz=corner_hz, rho=rho, slope=slope) for _ in range(54)]
    if hum:
        quiet = [x + _hum(rng, x.size) for x in quiet]
    found = estimate_noise(quiet, sample_rate_hz=RATE_HZ)
    assert found is not None
    return found


@pytest.mark.parametrize("hum", [False, True])
@pytest.mark.parametrize("slope", [1, 2])
@pytest.mark.parametrize("corner_hz", [2e3, 6e3, 25e3])
def test_slope_and_corner_are_found_with_and_without_hum(
    corner_hz: float, slope: int, hum: bool
) -> None:
    """The frequency below which the noise rises comes out to a fifth, hum or no hum."""
    found = _estimate(1, corner_hz=corner_hz, hum=hum, slope=slope)
    assert found.slope == slope
    assert found.corner * RATE_HZ == pytest.approx(corner_hz, rel=0.2)
    assert found.order == 256


@pytest.mark.parametrize("hum", [False, True])
@pytest.mark.parametrize("rho", [0.0, 0.3, 0.6])
def test_white_and_correlated_noise_do_not_rise(rho: float, hum: bool) -> None:
    """White and AR(1) noise are given no 1/f part, and hum does not change their level."""
    for seed in range(3):
        found = _estimate(seed, corner_hz=0.0, rho=rho, hum=hum)
        assert found.corner == 0.0
        assert found.order <= 3
        assert found.rms == pytest.approx(RMS_V, rel=0.02)


def test_what_may_be_there_unseen_is_told() -> None:
    """The largest corner that the stretches allow lies above the true one, and not far."""
    for corner_hz in (0.0, 400.0, 3e3):
        found = _estimate(6, corner_hz=corner_hz)
        assert found.corner_below is not None
        assert found.corner_below > found.corner
        assert corner_hz < found.corner_below * RATE_HZ < 2.0 * corner_hz + 1000.0
    longer = estimate_noise(
        [RMS_V * np.random.default_rng(k).standard_normal(20_000) for k in range(54)],
        sample_rate_hz=RATE_HZ,
    )
    assert longer is not None
    assert longer.corner_below is not None
    assert longer.corner_below * RATE_HZ < 250.0


def test_hum_is_told_as_drift() -> None:
    """What was taken off is stated beside what noise would leave there."""
    still = _estimate(2, corner_hz=4e3)
    moved = _estimate(2, corner_hz=4e3, hum=True)
    assert still.drift_rms == pytest.approx(still.drift_expected_rms, rel=0.2)
    assert moved.drift_rms is not None
    assert moved.drift_rms > 3 * moved.drift_expected_rms


@pytest.mark.parametrize("slope", [1, 2])
def test_whitened_noise_is_white_down_to_a_kilohertz(slope: int) -> None:
    """Other records of the same noise, whitened, are flat, and white from the first sample on."""
    found = _estimate(3, corner_hz=2e4, slope=slope)
    rng = np.random.default_rng(4)
    records = [_record(rng, 3000, corner_hz=2e4, rho=0.0, slope=slope) for _ in range(200)]
    white = np.stack([found.whiten(one) for one in records])
    power = np.mean(np.abs(np.fft.rfft(white, axis=1)) ** 2, axis=0) / white.shape[1]
    assert np.mean(power[4:]) == pytest.approx(1.0, abs=0.02)
    for low, high in ((3, 6), (6, 12), (12, 48), (48, 1500)):  # lines of 333 Hz
        assert np.mean(power[low:high]) == pytest.approx(1.0, abs=0.15)
    assert np.mean(white[:, 1:256] ** 2) == pytest.approx(1.0, abs=0.03)


def test_a_long_filter_is_the_exact_whitening_of_its_noise() -> None:
    """Where a window is no longer than the filter, rows are those of the inverse Cholesky root."""
    model = Slow(np.array([0.3]), 1.0, 0.02, 0.0)
    taps, variance, head = whitening_filter(model, 100)
    noise = NoiseModel(taps, float(np.sqrt(variance)), 1.0, 1000, "pre-trigger", head=head)
    _, least, root = whitening_filter(model, 60)
    np.testing.assert_allclose(noise.whiten(np.eye(60)), root / np.sqrt(least), atol=1e-9)


def test_a_long_filter_whitens_as_the_sum_that_it_is() -> None:
    """By Fourier transform or sample by sample, vector or columns: the same; none is lost."""
    taps, variance, head = whitening_filter(Slow(np.array([0.3]), 1.0, 0.02, 0.0), 100)
    noise = NoiseModel(taps, float(np.sqrt(variance)), 1.0, 1000, "pre-trigger", head=head)
    values = np.random.default_rng(5).standard_normal((700, 3)).cumsum(axis=0)
    wanted = lfilter(np.append(1.0, -taps), [1.0], values, axis=0)[100:] / np.sqrt(variance)
    assert noise.history == 0
    assert noise.whiten(values).shape == values.shape
    np.testing.assert_allclose(noise.whiten(values)[100:], wanted, atol=1e-9)
    np.testing.assert_allclose(noise.whiten(values), noise.whiten(np.asfortranarray(values)))
    np.testing.assert_allclose(noise.whiten(values)[:, 1], noise.whiten(values[:, 1]), atol=1e-9)


@pytest.mark.parametrize("corner_hz", [0.0, 300.0, 1e3, 3e3])
@pytest.mark.parametrize("rho", [0.0, 0.6])
def test_a_score_promises_at_least_half_of_what_a_search_brings(
    corner_hz: float, rho: float
) -> None:
    """No 1/f part that is worth its price is missed by asking the score first."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        quiet = [_record(rng, 1490, corner_hz=corner_hz, rho=rho) for _ in range(3)]
        seen = pooled_spectrum(quiet, RATE_HZ)
        assert seen is not None
        short = np.array([rho]) if rho else np.zeros(0)
        found = with_slow_part(seen, short)
        without = max(autoregressive(seen, a).likelihood for a in (short, found.short))
        gain = 2.0 * (found.likelihood - without)
        assert gain <= SLOW_PRICE or promised_gain(seen, short) >= 0.5 * gain
