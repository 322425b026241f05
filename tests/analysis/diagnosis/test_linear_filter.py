"""Frequencies, dampings and impulse responses that shots share are found."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.basis.linear_filter import (
    TUNED,
    best_damped,
    best_frequency,
    impulse_columns,
    tuned_columns,
)

RATE = 1e6


@pytest.mark.parametrize("family", sorted(TUNED))
def test_a_shared_frequency_is_found_whatever_the_phases(family):
    """Sizes and phases differ from shot to shot, the frequency does not."""
    rng = np.random.default_rng(11)
    t = np.arange(2000) / RATE
    truth = TUNED[family][20]
    signals, residuals = [], []
    for _ in range(4):
        pulse = np.exp(-(((t - 3e-4) / 2e-5) ** 2)) + 0.0 * t
        columns = tuned_columns(family, pulse, RATE, truth)
        signals.append(pulse)
        residuals.append(columns @ rng.standard_normal(2))
    assert best_frequency(family, signals, residuals, [RATE] * 4) == truth


def test_a_shared_damping_is_found_with_its_frequency():
    """A resonance that dies within a period or two is no mode of a twentieth's damping."""
    rng = np.random.default_rng(12)
    t = np.arange(2000) / RATE
    pulses = [np.exp(-(((t - 3e-4) / width) ** 2)) for width in (2e-5, 3e-5, 4e-5)]
    w = 2.0 * np.pi * 783.0
    residuals = []
    for pulse in pulses:
        size, phase = rng.uniform(0.5, 2.0), rng.uniform(0.0, 2.0 * np.pi)
        response = size * np.exp(-0.27 * w * t) * np.cos(w * t + phase)
        residuals.append(np.convolve(pulse, response)[: t.size])
    frequency, zeta = best_damped(pulses, residuals, [RATE] * 3)
    assert frequency == pytest.approx(783.0, rel=0.01)
    assert zeta == pytest.approx(0.27, rel=0.02)


def test_an_echo_that_disperses_is_a_free_impulse_response():
    """Three delayed copies, each smeared: one response for pulses of any width."""
    t = np.arange(2000) / RATE
    copies = ((0.1, 90), (-0.05, 400), (0.02, 800))

    def late(pulse):
        smeared = np.convolve(pulse, np.ones(16) / 16.0)
        return sum(a * np.roll(smeared, d)[: t.size] for a, d in copies)

    pulses = [np.exp(-(((t - 3e-4) / width) ** 2)) for width in (2e-5, 3e-5, 4e-5)]
    columns = [impulse_columns(pulse, RATE)[1] for pulse in pulses]
    wanted = [late(pulse) for pulse in pulses]
    learned = np.linalg.lstsq(np.vstack(columns[:2]), np.concatenate(wanted[:2]), rcond=1e-9)[0]
    left = wanted[2] - columns[2] @ learned
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(wanted[2])
