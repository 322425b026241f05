"""Hum in short quiet stretches is found as hum, and told with the size it has in each shot."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from analysis.diagnosis.candidate import _alike, explains_more_before
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
from analysis.effects.library import library
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from analysis.written_numbers import measured

from .conftest import small_campaign

HUM_V = 0.03


@pytest.fixture(scope="module")
def humming(tmp_path_factory: pytest.TempPathFactory) -> Diagnosis:
    """Eight shots with hum of 50 Hz and its third harmonic, another phase in each."""
    folder = tmp_path_factory.mktemp("humming")
    values = {"amplitude_v": HUM_V, "frequency_hz": 50.0, "harmonics": 2.0}
    return diagnose_campaign(small_campaign(folder, "mains_hum", **values))


def test_hum_is_found_and_not_taken_for_noise(humming: Diagnosis) -> None:
    """The noise is what it is without hum; the residual is hum, and after it noise is left.

    No record holds a period of it: a baseline that drifts may do the same.
    """
    found = diagnosis_json(humming, software="impactd test")
    assert found["verdict"] == "family"
    assert [e["id"] for e in found["effects"]] == ["mains_hum"]
    assert found["effects"][0]["confusable_with"] == ["mains_hum:drift"]
    assert found["noise_rms_V"] == pytest.approx(1.5e-3, rel=0.1)
    assert found["after"]["rms_V"] == pytest.approx(found["noise_rms_V"], rel=0.05)
    assert found["before"]["rms_V"] > 2 * found["noise_rms_V"]
    assert any("drift" in line for line in found["noise"]["said"])
    json.dumps(found, allow_nan=False)


def test_sizes_of_single_shots_are_told_as_median_and_range(humming: Diagnosis) -> None:
    """A number of every shot is one line: the middle, the ends and how many."""
    found = diagnosis_json(humming, software="impactd test")
    size = found["effects"][0]["parameters"]["size_rms"]
    assert size["shots"] == 8
    assert 0 < size["least"] < size["value"] < size["most"] < 2 * HUM_V
    assert size["u"] is None
    assert measured(size).endswith("over 8 shots)")


def test_no_line_claims_a_likelihood_for_an_unfinished_fit(humming: Diagnosis) -> None:
    """A candidate that fits worse than nothing is said to be unfinished, without a number."""
    found = diagnosis_json(humming, software="impactd test")
    values = [line["delta_log_likelihood"] for line in found["candidates"]]
    assert np.min([v for v in values if v is not None]) > -1.0
    assert all("noise variances" not in (line["why_not"] or "") for line in found["candidates"])


def test_what_the_release_puts_on_the_line_is_no_hum() -> None:
    """The mains do not know when a sphere was let go: the shots of a height share no phase."""
    rng = np.random.default_rng(8)
    heights = np.repeat([0.01, 0.03, 0.05], 6).tolist()
    free = rng.standard_normal((18, 6))
    assert not _alike(free, heights)
    assert not _alike(free, [None] * 18)
    of_a_height = np.repeat(rng.standard_normal((3, 6)), 6, axis=0)
    assert _alike(of_a_height + 0.5 * free, heights)
    assert not _alike(of_a_height[::3], heights[::3])  # two of each say too little


def test_over_a_part_of_a_period_hum_and_a_drift_are_one(tmp_path: Path) -> None:
    """A baseline with another slope in each shot is hum or a drift; records of periods tell."""
    clean, rng = small_campaign(tmp_path), np.random.default_rng(3)
    drifting = []
    for shot in clean.shots:
        drift = rng.uniform(-0.02, 0.02) * np.linspace(0.0, 1.0, shot.signal.size)
        drifting.append(dataclasses.replace(shot, signal=shot.signal + drift))
    found = diagnose_campaign(dataclasses.replace(clean, shots=tuple(drifting)))
    assert (found.verdict, found.effect_ids) == ("family", ["mains_hum"])
    assert found.confusable == ["mains_hum:drift"]


def test_periods_before_the_trigger_tell_hum_from_a_drift(tmp_path: Path) -> None:
    """No slow drift follows 40 ms of 50 Hz."""
    clean, rng = small_campaign(tmp_path), np.random.default_rng(3)
    problem = build(clean, model_named("kv2"))
    longer = []
    for item in problem.shots:
        time_s = np.arange(40_000) / item.frame.sample_rate_hz
        hum = 0.01 * np.sin(2 * np.pi * 50.0 * time_s + rng.uniform(0, 2 * np.pi))
        before = hum + 1.5e-3 * rng.standard_normal(time_s.size)
        shot = dataclasses.replace(
            item.shot,
            signal=np.concatenate([before, item.shot.signal]),
            trigger_index=item.shot.trigger_index + time_s.size,
        )
        longer.append(dataclasses.replace(item, shot=shot))
    hum_of_50_hz = library()["mains_hum"]
    (drift,) = hum_of_50_hz.lookalikes
    assert explains_more_before(longer, hum_of_50_hz, drift)
    assert not explains_more_before(list(problem.shots), hum_of_50_hz, drift)
