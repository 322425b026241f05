"""A zero line that moves is noise as long as noise may move it like that; hum moves it not so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.score_test import WANDER, ScoreTest, _slow_powers, p_of_wander
from analysis.diagnosis.stepwise.forward import make_step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign

FAINT_HZ = 400.0
"""A 1/f part that 27 stretches of 1.5 ms do not show."""


def _asked(folder: Path, corner_hz: float, hum_v: float = 0.0) -> tuple[ScoreTest, float]:
    """Return the answers for 27 shots, and how likely their zero lines move by noise."""
    hum = {"amplitude_v": hum_v, "frequency_hz": 50.0, "harmonics": 2.0}
    settings = dataclasses.replace(
        CampaignSettings(),
        repeats=1,
        noise=NoiseSettings(2e-3, pink_corner_hz=corner_hz),
        effects=(make_effect("mains_hum", hum),) if hum_v else (),
    )
    campaign = read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 4)))
    problem = build(campaign, model_named("kv2"))
    assert problem.shots[0].noise.corner == 0.0
    linearised = make_step(problem, joint.fit(problem, prepare(problem)))
    return linearised.score_test, p_of_wander(linearised.linearised)


def test_noise_too_slow_to_be_seen_is_no_structure(tmp_path: Path) -> None:
    """It moves the zero lines more than white noise does, in the ratio that 1/f has."""
    score_test, p = _asked(tmp_path, FAINT_HZ)
    wander = score_test.answers[WANDER]
    assert wander.gain > 1.5 * wander.dof
    assert p > 0.01
    assert not score_test.structured


def test_hum_below_the_noise_is_structure(tmp_path: Path) -> None:
    """It moves the first order and hardly the others, which no 1/f does."""
    score_test, p = _asked(tmp_path, 0.0, hum_v=1e-3)
    assert p < 1e-3 * CRITERIA.structure.false_alarm_rate
    assert score_test.structured
    assert score_test.strongest.family == WANDER[0]


def test_slow_noise_moves_the_orders_as_drawn_noise_does() -> None:
    """The powers of the orders against those of 4000 stretches cut out of long 1/f noise."""
    rng = np.random.default_rng(9)
    n, long = 512, 1 << 16
    amplitude = np.zeros(long // 2 + 1)
    amplitude[1:] = np.sqrt(long / np.arange(1, long // 2 + 1))
    x = np.linspace(-1.0, 1.0, n)
    orders = np.linalg.qr(np.polynomial.legendre.legvander(x, 3))[0][:, 1:]
    seen = np.zeros(3)
    for _ in range(40):
        noise = np.fft.irfft(np.fft.rfft(rng.standard_normal(long)) * amplitude, long)
        stretches = noise[: 100 * n].reshape(100, n)
        seen += np.sum((stretches @ orders) ** 2, axis=0)
    assert seen / 4000 == pytest.approx(_slow_powers(n), rel=0.1)
