"""Hum in short quiet stretches is found as hum, and told with the size it has in each shot."""

from __future__ import annotations

import json

import numpy as np
import pytest

from analysis.diagnosis.candidate import _alike
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.procedure import Diagnosis, diagnose_campaign
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
    """The noise is what it is without hum; the residual is hum, and after it noise is left."""
    found = diagnosis_json(humming, software="impactd test")
    assert found["verdict"] == "identified"
    assert [e["id"] for e in found["effects"]] == ["mains_hum"]
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
