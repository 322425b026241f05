"""What a converter or an amplifier does without a name is learned and holds on other shots."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.basis.nonlinearity import (
    best_ripple,
    ripple_columns,
    slope_columns,
    steepest,
)
from analysis.diagnosis.discrepancy.fitted import learn
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_rms
from analysis.fit.problem import build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named

from .conftest import small_campaign

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
    ("effect", "values", "part"),
    [
        ("x_slew_limit", {"limit_v_per_s": 1.5e5}, ("slew", "rig")),
        ("x_lost_samples", {"lost_s": 2e-6}, ("jump", "shot")),
        (
            "x_adc_nonlinearity",
            {"amplitude_codes": 60.0, "period_codes": 700.0},
            ("ripple", "rig"),
        ),
        (
            "x_thermal_tail",
            {"offset_per_v_s": 40.0, "cooling_s": 1e-3},
            ("warmth", "rig"),
        ),
        (
            "x_interleaved_converter",
            {"mismatch": 0.04, "skew_s": 3e-8},
            ("alternate", "shot"),
        ),
    ],
)
def test_what_no_library_names_is_learned_and_holds_on_other_shots(tmp_path, effect, values, part):
    """The error on held-out shots falls at least threefold."""
    problem = build(small_campaign(tmp_path, effect, **values), model_named("kv2"))
    fitted = joint.fit(problem, prepare(problem))
    before = heldout_rms(problem, fitted)
    learned = learn(problem, fitted, [part])
    assert learned.heldout_rms < before / 3
