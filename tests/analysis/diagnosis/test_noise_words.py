"""What a person is told about the noise is what the noise is."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from analysis.diagnosis.document.noise_words import (
    frequency,
    noise_json,
    noise_sentences,
    times_noise,
    two_digits,
)
from analysis.diagnosis.held_out import quality
from analysis.noise import NoiseModel
from analysis.quantisation import Coarse

PLAIN = NoiseModel(np.zeros(0), 1e-3, 1e-3, 5000, "pre-trigger")


def _changed(**changes: object) -> NoiseModel:
    return dataclasses.replace(PLAIN, **changes)


@pytest.mark.parametrize(
    ("noise", "said"),
    [
        (PLAIN, "white"),
        (_changed(coefficients=np.array([0.3])), "order 1"),
        (_changed(coefficients=np.full(99, 1e-3), corner=4.6e-3), "1/f below 4.6 kHz"),
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
    found = noise_json(quality(clean.steps[0].problem, clean.steps[0].fitted))
    (entry,) = found["instruments"]
    assert entry["source"] == "pre-trigger"
    assert entry["quantity"] == "voltage"
    assert entry["kind"] in ("white", "autoregressive", "1/f")
    assert found["said"]
