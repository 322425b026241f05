"""Fits and diagnoses of the same pulses at any sampling rate, and of any length."""

from __future__ import annotations

import dataclasses
import json
import math
from importlib import resources

import jsonschema
import numpy as np
import pytest

from analysis.campaign import Campaign
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.problem import build
from analysis.fit.thinning import LONGEST_PULSE, thinned
from analysis.fit.window import cut
from analysis.model.impact_model import model_named
from impactd.diagnosis.run import diagnose
from tests.analysis.any_rate import Scale, campaign_at, drawn

CORNERS = [
    Scale(rate, samples, quantity)
    for rate in (50.0, 1e7)
    for samples, quantity in ((5, "voltage"), (50_000, "acceleration_m_per_s2"))
]
BUDGET_S = 6.0


def _is_a_diagnosis(campaign: Campaign, budget_s: float) -> None:
    schema = json.loads((resources.files("impactd") / "schemas" / "diagnosis.json").read_text())
    document = diagnose(campaign, budget_s=budget_s)
    jsonschema.validate(json.loads(json.dumps(document, allow_nan=False)), schema)


@pytest.mark.parametrize("scale", CORNERS, ids=lambda scale: scale.label)
def test_the_smallest_and_the_largest_are_fitted(scale: Scale) -> None:
    """A fit of the extremes of rate and length ends with an outcome and without a warning."""
    found = fit_campaign(campaign_at(scale), heldout=False)
    assert found.outcome.message
    assert len(found.shots) == scale.shots


def test_an_empty_grid_of_frequencies_ends_nothing() -> None:
    """At 100 Hz, where no frequency of the grids is resolved, there is a diagnosis in time."""
    _is_a_diagnosis(campaign_at(Scale(100.0, 40)), BUDGET_S)


def test_a_pulse_too_long_for_a_window_is_thinned_until_it_is_whole() -> None:
    """Of a pulse of 50 000 samples the window holds the whole, and the fit says at what rate."""
    campaign = campaign_at(Scale(1e3, 50_000))
    problem = build(campaign, model_named("kv2"))
    window = problem.shots[0].window
    rate = problem.shots[0].frame.sample_rate_hz
    assert 100 < window.width_s * rate < LONGEST_PULSE
    assert window.width_s * rate < window.signal.size
    assert window.width_s == pytest.approx(50.0, rel=0.2)
    assert any("one in 243 was fitted, at 4.115 Hz" in told for told in problem.assumptions)


def test_what_fits_into_a_window_is_left_alone() -> None:
    """A campaign whose pulses are short, or where none is seen, is the same object as before."""
    short = campaign_at(Scale(1e6, 150))
    assert thinned(short) == (short, [])
    quiet = np.random.default_rng(1).standard_normal(60_000)
    silent = dataclasses.replace(
        short, shots=tuple(dataclasses.replace(s, signal=quiet) for s in short.shots)
    )
    assert thinned(silent) == (silent, [])


@pytest.mark.parametrize("quantum", [None, 1e-4])
def test_a_kept_sample_stays_where_it_was(quantum: float | None) -> None:
    """Means are centred on the samples that are kept, and codes stay codes."""
    long = campaign_at(Scale(1e6, 20_000, noise_share=1e-9))
    shots = tuple(dataclasses.replace(s, quantum=quantum) for s in long.shots)
    fewer, _ = thinned(dataclasses.replace(long, shots=shots))
    before, after = shots[0], fewer.shots[0]
    factor = round(before.sample_rate_hz / after.sample_rate_hz)
    kept = before.signal[::factor]
    peak = float(np.ptp(before.signal))
    allowed = 0.0 if quantum is not None else 1e-4 * peak
    assert np.abs(after.signal[2:-2] - kept[2:-2]).max() <= allowed
    assert cut(after).width_s == pytest.approx(20_000 / 1e6, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_any_rate_and_length_gives_a_document(seed: int) -> None:
    """Whatever the rate and the length, a diagnosis is a valid document, without a warning."""
    scale = drawn(seed)
    assert 50.0 <= scale.sample_rate_hz <= 1e7
    assert math.isfinite(scale.noise_share)
    _is_a_diagnosis(campaign_at(scale), 2 * BUDGET_S)
