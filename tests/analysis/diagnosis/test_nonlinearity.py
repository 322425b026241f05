"""Limits, ripples and bent springs have the columns that they should have."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.diagnosis.basis.nonlinearity import (
    best_ripple,
    mount_columns,
    ripple_columns,
    slope_columns,
    steepest,
)

RATE = 1e6


def test_a_limited_slope_is_that_of_a_ramp():
    """A triangle of twice the slope: out along the limit, and back where both meet."""
    t = np.arange(400.0)
    triangle = np.maximum(100.0 - np.abs(t - 150.0), 0.0)
    labels, columns = slope_columns(triangle, RATE, 0.5 * RATE)
    expected = np.where(t < 50.0, 0.0, np.minimum(0.5 * (t - 50.0), triangle))
    meets = 50.0 + 400.0 / 3.0  # 0.5 (t - 50) = 250 - t
    expected = np.where(t > meets, np.maximum(200.0 / 3.0 - 0.5 * (t - meets), 0.0), expected)
    assert len(labels) == 2
    np.testing.assert_allclose(triangle + columns[:, 0], expected, atol=1.0)
    faster = triangle + slope_columns(triangle, RATE, 0.505 * RATE)[1][:, 0]
    np.testing.assert_allclose(0.1 * columns[:, 1], faster - expected, atol=0.6)


def test_the_steepest_slope_of_noisy_records_is_their_limit():
    """Seven samples take most of the noise out."""
    rng = np.random.default_rng(4)
    records = [np.clip(0.3 * (np.arange(500.0) - 200.0), 0.0, 30.0) for _ in range(20)]
    noisy = [r + 0.01 * rng.standard_normal(r.size) for r in records]
    assert steepest(noisy, [RATE] * 20) == pytest.approx(0.3 * RATE, rel=0.05)


def test_the_period_of_a_sawtooth_is_found_among_pulses():
    """A bit that sticks: the error is a sawtooth of the level, in shots of any height."""
    rng = np.random.default_rng(9)
    t = np.arange(2000.0)
    signals = [h * np.exp(-(((t - 300.0) / 40.0) ** 2)) for h in (0.4, 0.7, 1.0)]
    period = 1.0 / 43.3
    wrong = [0.01 * ((s / period) % 1.0 - 0.5) for s in signals]
    residuals = [w + 2e-3 * rng.standard_normal(t.size) for w in wrong]
    cycles = best_ripple(signals, residuals, 1.0)
    assert cycles == pytest.approx(43.3, abs=0.1)
    labels, columns = ripple_columns(signals[2], 1.0, cycles)
    assert len(labels) == columns.shape[1]
    steep = np.abs(t - 300.0) < 60.0
    left = wrong[2] - columns @ np.linalg.lstsq(columns[steep], wrong[2][steep], rcond=1e-9)[0]
    assert np.std(left[steep]) < 0.5 * np.std(wrong[2][steep])


@pytest.mark.parametrize(
    ("force", "law"),
    [
        ("x^2", lambda x, v: x * x),
        ("|x|", lambda x, v: abs(x)),
        ("v |x|", lambda x, v: v * abs(x)),
        ("x^3", lambda x, v: x**3),
    ],
)
def test_a_bent_spring_or_damper_is_what_an_integration_of_it_gives(force, law):
    """A small force on an oscillator, integrated to 1e-10, against its column."""
    omega, zeta, share = 2 * math.pi * 17.3e3, 0.07, 1e-3
    t = np.arange(800) / RATE

    def motion(small):
        def slopes(at, y):
            x, v = y[0], y[1] / omega
            push = math.exp(-(((at - 1.5e-4) / 3e-5) ** 2)) + small * law(x, v)
            return [y[1], omega**2 * (push - x) - 2 * zeta * omega * y[1]]

        ran = solve_ivp(slopes, (0, t[-1]), [0, 0], t_eval=t, rtol=1e-10, atol=1e-13, max_step=1e-6)
        return ran.y[0]

    plain = motion(0.0)
    labels, columns = mount_columns(plain, RATE, 1.0, (omega, zeta))
    wanted = (motion(share) - motion(-share)) / (2 * share)
    found = 10.0 * columns[:, labels.index(f"crystal force {force}")]
    assert np.linalg.norm(found - wanted) < 0.01 * np.linalg.norm(wanted)
