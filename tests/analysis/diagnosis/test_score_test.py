"""Structure is what many overlapping tests see, what none sees, and no baseline moved by noise."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from analysis.campaign import Campaign
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.diagnosis.score_test import (
    ASKED,
    WANDER,
    ScoreTest,
    _slow_powers,
    family_wise,
    has_clear_surplus,
    independent_tests,
    p_of_wander,
    shows_structure,
)
from analysis.diagnosis.selection import Selection, Step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign

from .conftest import small_campaign

ADDED_V = 1e-3
CLEAN_CAMPAIGNS = 300
LEAST_P = 1e-3
"""Of the test for uniformity: it fails once in a thousand sound programs."""
FAINT_HZ = 400.0
"""A 1/f part that 27 stretches of 1.5 ms do not show."""


def _restless(campaign: Campaign) -> Campaign:
    """Return a campaign with white noise added after the trigger."""
    rng = np.random.default_rng(8)
    shots = []
    for shot in campaign.shots:
        signal = np.array(shot.signal)
        after = slice(shot.trigger_index, None)
        signal[after] += ADDED_V * rng.standard_normal(signal[after].size)
        shots.append(dataclasses.replace(shot, signal=signal))
    return dataclasses.replace(campaign, shots=tuple(shots))


@pytest.fixture(scope="module")
def restless(tmp_path_factory: pytest.TempPathFactory) -> Step:
    """A campaign whose noise is stronger once the sphere has come."""
    campaign = _restless(small_campaign(tmp_path_factory.mktemp("restless")))
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    return Step(problem, joint.fit(problem, nuisances))


def test_what_is_far_from_noise_needs_no_test_unless_the_noise_is_a_guess(restless):
    """The test would say the same; by noise that is a guess it alone can tell."""
    theta = restless.fitted.theta.copy()
    theta[0] += 1.0
    far = joint.fit(restless.problem, restless.fitted.nuisances, theta=theta, max_iterations=0)
    step = Step(restless.problem, far)
    assert step.structured
    assert step.tested is None
    assert step.score_test.structured
    noise = dataclasses.replace(restless.problem.shots[0].noise, source="differences")
    shots = [dataclasses.replace(item, noise=noise) for item in restless.problem.shots]
    guessed = Step(dataclasses.replace(restless.problem, shots=shots), far)
    assert guessed.structured
    assert guessed.tested is not None


def test_a_clean_campaign_has_no_surplus(clean):
    """And what is left of it is what chance leaves."""
    score_test = clean.steps[0].score_test
    assert score_test.surplus == 0.0
    assert not score_test.structured
    assert score_test.left < 100.0


def test_a_faint_effect_is_seen_along_its_own_column(tmp_path, leaky):
    """No family of columns sees it; it is named, although it leads by less than usual."""
    campaign = small_campaign(tmp_path, "coupler_highpass", time_constant_s=0.45)
    found = diagnose_campaign(campaign)
    score_test = found.steps[0].score_test
    family = min(a.p_value for a in score_test.answers.values())
    assert family * len(score_test.answers) > CRITERIA.false_alarm_rate
    (effect, scope), clearest = min(score_test.of_effects.items(), key=lambda one: one[1].p_value)
    assert (effect.partition("@")[0], scope, clearest.dof) == ("coupler_highpass", "rig", 1)
    assert score_test.structured
    assert "coupler_highpass" in (*found.effect_ids, *found.confusable)
    assert not leaky.steps[-1].score_test.of_effects  # beside an effect nobody is asked


def test_a_residual_that_no_family_sees_is_structure_by_its_power(restless):
    """White noise fits no column, and yet it was not there before."""
    score_test = restless.score_test
    samples = sum(s.white.size for s in restless.linearised.shots)
    noise = restless.problem.shots[0].noise
    # what whitens the old noise colours the new: 1 + a_1^2 + ... of its power
    whitened = 1.0 + float(np.sum(np.square(noise.coefficients)))
    expected = samples * whitened * (ADDED_V / noise.innovation_rms) ** 2
    assert score_test.surplus == pytest.approx(expected, rel=0.2)
    assert max(a.gain for a in score_test.answers.values()) < 0.02 * score_test.surplus
    assert score_test.left == score_test.surplus
    assert score_test.structured
    assert not Selection([restless], []).adequate


def test_a_clear_surplus_needs_no_column(restless):
    """The whole test finds it, too."""
    step = Step(restless.problem, restless.fitted)
    assert has_clear_surplus(step.residual)
    assert step.structured
    assert step.tested is None
    assert step.score_test.structured


def test_one_test_that_fails_needs_no_other(leaky, clean):
    """Alone it finds the structure that all find, and none where there is none."""
    found, noise = leaky.steps[0], clean.steps[0]
    assert shows_structure(found.problem, found.fitted, found.score_test.clearest)
    again = Step(found.problem, found.fitted, likely=found.score_test.clearest)
    assert again.structured
    assert again.tested is None
    assert not shows_structure(noise.problem, noise.fitted, noise.score_test.clearest)
    assert not Step(noise.problem, noise.fitted, likely=noise.score_test.clearest).structured


def test_a_level_that_is_a_guess_allows_no_such_verdict(restless):
    """Without a quiet stretch nobody knows how much noise is too much."""
    shots = [
        dataclasses.replace(item, noise=dataclasses.replace(item.noise, source="differences"))
        for item in restless.problem.shots
    ]
    guessed = Step(dataclasses.replace(restless.problem, shots=shots), restless.fitted)
    assert guessed.score_test.surplus == 0.0


def _looked_at(campaign: Campaign) -> Step:
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    return Step(problem, joint.fit(problem, nuisances))


def _drawn(folder: Path, seed: int) -> Campaign:
    """Return four shots of a clean rig, with noise of their own."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={"acetal": usual.spheres["acetal"]},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, seed)))


def test_a_test_asked_twice_is_one(clean):
    """Two that ask the same are one independent test, two that share little are nearly two."""
    linearised = clean.steps[0].linearised
    one = ("response", "rig")
    assert independent_tests(linearised, [one, one]) == pytest.approx(1.0, abs=0.2)
    assert 1.5 < independent_tests(linearised, [one, ("contact", "sphere")]) <= 2.0


def test_a_test_that_sees_nothing_is_one(tmp_path):
    """Without heights and rebounds no speed is promised, and none can be wrong."""
    whole = small_campaign(tmp_path)
    bare = {"drop_height_m": None, "restitution": None}
    shots = tuple(dataclasses.replace(shot, **bare) for shot in whole.shots)
    linearised = _looked_at(dataclasses.replace(whole, shots=shots)).linearised
    part = ("speed", "height")
    assert linearised.explain(*part, heldout=False).dof == 0
    assert independent_tests(linearised, [part]) == 1.0


def test_the_corrected_chance_lies_between_one_test_and_all(clean):
    """It is more than the smallest, less than Bonferroni's, and the same every time."""
    linearised = clean.steps[0].linearised
    found = family_wise(0.01, linearised, ASKED)
    assert 0.01 < found < 0.01 * len(ASKED)
    assert found == family_wise(0.01, linearised, ASKED)


def test_structure_stays_structure(leaky):
    """A clear residual keeps a chance below the false-alarm rate."""
    assert leaky.steps[0].score_test.structured


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_clean_campaigns_have_every_p_value_alike(tmp_path):
    """Over 300 clean campaigns it is uniform."""
    found = [
        _looked_at(_drawn(tmp_path / str(seed), seed)).score_test.p_value
        for seed in range(CLEAN_CAMPAIGNS)
    ]
    quartiles = np.quantile(found, [0.25, 0.5, 0.75])
    p = kstest(found, "uniform").pvalue
    print(f"{CLEAN_CAMPAIGNS} clean campaigns: quartiles of p {quartiles.round(2)}, KS p {p:.2g}")
    assert p > LEAST_P


def _asked(folder: Path, corner_hz: float, hum_v: float = 0.0) -> tuple[ScoreTest, float]:
    """Return the answers for 27 shots, and how likely their baselines move by noise."""
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
    problem, nuisances = with_start(problem)
    linearised = Step(problem, joint.fit(problem, nuisances))
    return linearised.score_test, p_of_wander(linearised.linearised)


def test_noise_too_slow_to_be_seen_is_no_structure(tmp_path: Path) -> None:
    """It moves the baselines more than white noise does, in the ratio that 1/f has."""
    score_test, p = _asked(tmp_path, FAINT_HZ)
    wander = score_test.answers[WANDER]
    assert wander.gain > 1.5 * wander.dof
    assert p > 0.01
    assert not score_test.structured


def test_hum_below_the_noise_is_structure(tmp_path: Path) -> None:
    """It moves the first order and hardly the others, which no 1/f does."""
    score_test, p = _asked(tmp_path, 0.0, hum_v=1e-3)
    assert p < 1e-3 * CRITERIA.false_alarm_rate
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
    assert seen / 4000 == pytest.approx(_slow_powers(n, 1), rel=0.1)
