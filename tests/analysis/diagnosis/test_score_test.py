"""Structure is also what no family of columns sees."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.forward_selection import Selection, Step, make_step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named

from .conftest import small_campaign

ADDED_V = 1e-3


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
    problem = build(campaign, model_named("kv2"))
    return make_step(problem, joint.fit(problem, prepare(problem)))


def test_a_clean_campaign_has_no_surplus(clean):
    """And what is left of it is what chance leaves."""
    score_test = clean.steps[0].score_test
    assert score_test.surplus == 0.0
    assert not score_test.structured
    assert score_test.left < 100.0


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


def test_a_level_that_is_a_guess_allows_no_such_verdict(restless):
    """Without a quiet stretch nobody knows how much noise is too much."""
    shots = [
        dataclasses.replace(item, noise=dataclasses.replace(item.noise, source="differences"))
        for item in restless.problem.shots
    ]
    guessed = make_step(dataclasses.replace(restless.problem, shots=shots), restless.fitted)
    assert guessed.score_test.surplus == 0.0
