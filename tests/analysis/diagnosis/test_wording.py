"""What a person is told of noise, families of columns and single shots is what they are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from analysis.diagnosis.discrepancy.choice import (
    ALSO,
    BEYOND_FIRST_ORDER,
    FORCES,
    LAST,
    LEARNABLE,
    REFINED,
)
from analysis.diagnosis.document.diagnosis_json import noise_json
from analysis.diagnosis.document.wording import (
    FAMILIES,
    dependence,
    frequency,
    noise_sentences,
    polarity_sentences,
    times_noise,
    told_apart,
    two_digits,
)
from analysis.diagnosis.held_out import as_fit_result
from analysis.diagnosis.localisation import BANK, SHARES
from analysis.diagnosis.score_test import ASKED
from analysis.fit.problem import FitShot, build
from analysis.model.impact_model import model_named
from analysis.noise import NoiseModel
from analysis.quantisation import Coarse
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign

LEARNED = {
    *(ALSO.get(family, family) for family, _ in (*LEARNABLE, *BEYOND_FIRST_ORDER, *LAST)),
    *(finer for forms in REFINED.values() for finer in forms),
    *(f"force_{form}" for form in FORCES),
}
"""Families that a discrepancy may be made of."""
PLAIN = NoiseModel(np.zeros(0), 1e-3, 1e-3, 5000, "pre-trigger")


def _changed(**changes: object) -> NoiseModel:
    return dataclasses.replace(PLAIN, **changes)


@pytest.mark.parametrize(
    ("noise", "said"),
    [
        (PLAIN, "white"),
        (_changed(coefficients=np.array([0.3])), "order 1"),
        (_changed(coefficients=np.full(99, 1e-3), corner=4.6e-3), "1/f below 4.6 kHz"),
        (_changed(coefficients=np.full(99, 1e-3), corner=5e-3, slope=2), "1/f^2 below 5 kHz"),
        (_changed(source="differences"), "colour is not known"),
        (_changed(coarse=Coarse(3e-3, 0.125, 0.02)), "step is 8 times the noise"),
    ],
)
def test_each_kind_of_noise_is_called_by_its_name(noise: NoiseModel, said: str) -> None:
    """White, correlated, rising, or not known: one sentence each."""
    (sentence,) = noise_sentences(noise, 1e6)
    assert said in sentence


def test_drift_before_the_trigger_is_told_apart_from_noise() -> None:
    """Slow waves beyond what noise makes get a sentence of their own; noise's own do not."""
    assert len(noise_sentences(_changed(drift_rms=1e-4, drift_expected_rms=9e-5), 1e6)) == 1
    _, drift = noise_sentences(_changed(drift_rms=3e-3, drift_expected_rms=1e-4), 1e6)
    assert "30 times" in drift


def test_squares_are_told_as_multiples_of_the_noise() -> None:
    """A person reads rms over noise, not variances."""
    assert times_noise(9.61) == "3.1"
    assert times_noise(9.65e6) == "3,106"
    assert times_noise(1.0) == "1"
    assert times_noise(1.0008) == "1.0004"


def test_a_difference_is_not_rounded_away() -> None:
    """Two numbers that differ look different, and end at the same digit."""
    assert told_apart(1.5048, 1.5042, 1.5) == ["1.505", "1.504", "1.500"]
    assert told_apart(132.71, 12.92, 0.15123) == ["132.7", "12.9", "0.151"]
    assert told_apart(1.5, 1.5) == ["1.50", "1.50"]


def test_numbers_are_said_and_not_computed():
    """Two digits, and no power of ten in a sentence."""
    assert [two_digits(one) for one in (4057.0, 2.44, 118_000.0, 0.5)] == [
        "4100",
        "2.4",
        "120000",
        "0.5",
    ]
    assert frequency(123_456.0) == "120 kHz"
    assert frequency(94.0) == "94 Hz"


def test_one_entry_for_each_instrument(clean) -> None:
    """Shots of one instrument share one entry, with its unit and where it was learned."""
    found = noise_json(as_fit_result(clean.steps[0].problem, clean.steps[0].fitted))
    (entry,) = found["instruments"]
    assert entry["source"] == "pre-trigger"
    assert entry["quantity"] == "voltage"
    assert entry["kind"] in ("white", "autoregressive", "1/f")
    assert found["said"]


def test_records_upside_down_are_told_where_others_are_not(clean) -> None:
    """Somebody exchanged two wires for a time; a rig that is wired so all the time is no news."""

    def said(turned: int) -> list[str]:
        shots = tuple(
            dataclasses.replace(shot, signal=-shot.signal) if at < turned else shot
            for at, shot in enumerate(campaign.shots)
        )
        problem = build(dataclasses.replace(campaign, shots=shots), model_named("kv2"))
        return polarity_sentences(as_fit_result(problem, clean.steps[0].fitted))

    campaign = clean.steps[0].problem.campaign
    assert said(0) == said(len(campaign.shots)) == []
    (two,) = said(2)
    assert two.startswith(f"The records {campaign.shots[0].name}, {campaign.shots[1].name} are")


def test_a_record_of_something_else_is_not_upside_down(clean) -> None:
    """A slow swing below zero, turned round, is no impact either."""
    campaign = clean.steps[0].problem.campaign
    first, *others = campaign.shots
    since = np.arange(first.signal.size) - first.trigger_index
    swing = first.signal[:100].mean() - 0.2 * np.exp(-((since / 300) ** 2))
    noise = 1e-3 * np.random.default_rng(1).standard_normal(swing.size)
    shots = (dataclasses.replace(first, signal=swing + noise), *others)
    problem = build(dataclasses.replace(campaign, shots=shots), model_named("kv2"))
    assert problem.shots[0].window.polarity < 0
    assert polarity_sentences(as_fit_result(problem, clean.steps[0].fitted)) == []


@pytest.mark.parametrize("family", sorted(LEARNED | {family for family, _ in ASKED}))
def test_every_family_that_is_asked_or_learned_has_words(family):
    """In the verdict, the report and the list of slots."""
    assert FAMILIES[family] != family


@pytest.mark.parametrize("family", sorted({family for family, _ in BANK} - {"locked", "static"}))
def test_every_family_that_decides_on_a_slot_has_one(family):
    """Those that say nothing about where are left out by name."""
    assert max(SHARES.get(family, (0.0,))) > 0.0


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[FitShot]:
    """Fifty-four shots of three spheres, three coupons and three heights."""
    folder = tmp_path_factory.mktemp("shots")
    campaign = read_campaign(
        write_campaign_folder(folder, simulate_campaign(CampaignSettings(), 2))
    )
    return build(campaign, model_named("kv2")).shots


def test_chance_goes_with_nothing(shots: list[FitShot]) -> None:
    """Of 200 draws none is said to follow anything."""
    rng = np.random.default_rng(1)
    assert not any(dependence(rng.standard_normal(len(shots)).tolist(), shots) for _ in range(200))
    assert dependence([1.0] * len(shots), shots) == []
    assert dependence([1.0, 2.0], shots[:2]) == []


def test_a_shot_without_a_label_is_a_material_of_its_own(shots: list[FitShot]) -> None:
    """Names and the lack of one can be put in order."""
    bare = dataclasses.replace(shots[0].shot, sphere=None, surface=None)
    some = [dataclasses.replace(shots[0], shot=bare), *shots[1:]]
    assert dependence(list(range(len(some))), some) != []


def test_what_grows_on_one_coupon_is_told_with_the_coupon_and_the_order(
    shots: list[FitShot],
) -> None:
    """The others stay at nothing, and do not hide that it grows."""
    rng = np.random.default_rng(2)
    sizes = [
        1e-3 * (k / len(shots)) ** 2 * (s.shot.surface == "polycarbonate")
        for k, s in enumerate(shots)
    ]
    said = dependence((np.array(sizes) + 1e-6 * rng.standard_normal(len(shots))).tolist(), shots)
    assert len(said) == 2
    assert said[0].startswith("correlates with the coupon: aluminium ")
    assert said[1].startswith("rises from drop to drop on polycarbonate, rank correlation ")


def test_a_number_that_follows_the_height_falls_with_it(shots: list[FitShot]) -> None:
    """Over all shots, whatever they fall on."""
    rng = np.random.default_rng(3)
    values = [1.0 / (s.shot.drop_height_m or 1.0) + rng.normal() for s in shots]
    said = dependence(values, shots)
    assert any(
        line.startswith("falls with the drop height, rank correlation -0.9") for line in said
    )
