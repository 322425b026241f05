"""The noise model on noise of known level and colour."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from analysis.noise import estimate_noise, noise_from_differences


def _ar1(rho: float, samples: int, seed: int = 0, rms: float = 2.0) -> np.ndarray:
    white = np.random.default_rng(seed).standard_normal(samples + 500)
    return lfilter([1.0], [1.0, -rho], white * rms * np.sqrt(1 - rho**2))[500:]


@pytest.mark.parametrize("rho", [-0.4, 0.3, 0.6, 0.9])
def test_colour_and_level_are_recovered(rho: float) -> None:
    """AR(1) noise gives back its coefficient, its level and that of its innovations."""
    found = estimate_noise([_ar1(rho, 1500, seed) for seed in range(8)])
    assert found is not None
    assert found.coefficients[0] == pytest.approx(rho, abs=0.03)
    assert found.order <= 2
    assert found.rms == pytest.approx(2.0, rel=0.06)
    assert found.innovation_rms == pytest.approx(2.0 * np.sqrt(1 - rho**2), rel=0.03)


def test_white_noise_stays_white() -> None:
    """White noise is given no colour, so no sample is spent as history."""
    found = estimate_noise([_ar1(0.0, 2000, seed) for seed in range(5)])
    assert found is not None
    assert found.order == 0


def test_whitening_gives_unit_white_residuals() -> None:
    """Whitened noise has unit variance and no correlation left; columns whiten like vectors."""
    noise = _ar1(0.8, 20_000, 7)
    found = estimate_noise([noise[:10_000]])
    assert found is not None
    white = found.whiten(noise[10_000:])
    assert white.std() == pytest.approx(1.0, abs=0.03)
    assert abs(np.corrcoef(white[1:], white[:-1])[0, 1]) < 0.03
    columns = found.whiten(np.column_stack([noise, 2 * noise]))
    np.testing.assert_allclose(columns[:, 1], 2 * columns[:, 0])


def test_means_of_records_do_not_count_as_noise() -> None:
    """Records with different baselines have the noise of one record."""
    found = estimate_noise([_ar1(0.0, 1000, seed) + 50 * seed for seed in range(4)])
    assert found is not None
    assert found.rms == pytest.approx(2.0, rel=0.05)


def test_level_never_falls_below_rounding() -> None:
    """A record quieter than one converter step has the step's rounding noise, or a little more.

    What a step hides in a thousand samples is at most a fifth of it.
    """
    found = estimate_noise([np.zeros(1000)], quantum=3e-4)
    assert found is not None
    assert 3e-4 / np.sqrt(12) <= found.rms < 3e-4 * np.hypot(1 / np.sqrt(12), 1 / 5)


def test_too_few_quiet_samples_say_nothing() -> None:
    """Below two hundred samples no noise model is claimed."""
    assert estimate_noise([_ar1(0.0, 150)]) is None
    assert estimate_noise([_ar1(0.0, 20, seed) for seed in range(50)]) is None
    assert estimate_noise([np.zeros(1000)]) is None


def test_differences_see_the_level_under_a_smooth_pulse() -> None:
    """Third differences give the level of white noise although a pulse fills the record."""
    pulse = 300 * np.exp(-(((np.arange(600) - 300) / 60) ** 2))
    found = noise_from_differences([pulse + _ar1(0.0, 600, seed) for seed in range(5)])
    assert found.rms == pytest.approx(2.0, rel=0.08)
    assert found.source == "differences"
    assert found.order == 0


def test_differences_of_a_constant_record_are_finite() -> None:
    """A flat record still gives a positive, finite level."""
    assert noise_from_differences([np.zeros(100)]).rms > 0
