"""The p-value of many overlapping tests is that of as many independent ones as they amount to."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import kstest

from analysis.campaign import Campaign
from analysis.diagnosis.score_test import ASKED, family_wise, independent_tests
from analysis.diagnosis.stepwise.forward import Step, make_step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign

CLEAN_CAMPAIGNS = 300
LEAST_P = 1e-3
"""Of the test for uniformity: it fails once in a thousand sound programs."""


def _looked_at(campaign: Campaign) -> Step:
    problem = build(campaign, model_named("kv2"))
    return make_step(problem, joint.fit(problem, prepare(problem)))


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
    assert 1.5 < independent_tests(linearised, [one, ("speed", "shot")]) <= 2.0


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
