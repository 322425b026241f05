"""The low-pass of noise: its cut-off, and none where noise has another colour."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, lfilter

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.model_free import shown_by_records
from analysis.diagnosis.roll_off import roll_off
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from impactd.storage.campaign_folder import load_campaign

Array = NDArray[np.float64]

RATE_HZ, SAMPLES, TRIGGER = 1e5, 3000, 600
RECORDINGS = Path(__file__).parents[4] / "shared" / "data"


def campaign(seed: int, b: Array | list[float], a: Array | list[float]) -> Campaign:
    """Return nine pulses with noise behind one filter."""
    rng = np.random.default_rng(seed)
    t = (np.arange(SAMPLES) - TRIGGER) / RATE_HZ
    shots = []
    for number in range(9):
        whole = rng.uniform(0.6, 1.4) * np.exp(-((t / 1e-4) ** 2)) + rng.normal(0.0, 1e-3, SAMPLES)
        signal = np.asarray(lfilter(b, a, whole))
        shots.append(Shot(f"hit {number}", signal, RATE_HZ, TRIGGER, quantity="force_N"))
    return Campaign(tuple(shots))


@pytest.mark.parametrize("seed", range(8))
def test_the_cut_off_is_found(seed: int) -> None:
    """Of one digital pole or two, from a tenth to a third of the rate."""
    cutoff = float(np.random.default_rng(seed).uniform(1 / 10, 1 / 3))
    for b, a in (butter(1, cutoff, fs=1.0), butter(2, cutoff, fs=1.0)):
        found = roll_off(campaign(seed, b, a).shots)
        assert found is not None
        assert found.cutoff_hz == pytest.approx(cutoff * RATE_HZ, rel=0.25)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("decay", [0.3, 0.6, 0.8])
def test_autoregressive_noise_shows_none(seed: int, decay: float) -> None:
    """It looks like white noise behind one analogue pole, and needs none."""
    assert roll_off(campaign(seed, [1.0], [1.0, -decay]).shots) is None


@pytest.mark.parametrize("seed", range(8))
def test_noise_of_another_colour_shows_none(seed: int) -> None:
    """White noise, noise that rises with the frequency, and noise with a line."""
    assert roll_off(campaign(seed, [1.0], [1.0]).shots) is None
    assert roll_off(campaign(seed, [1.0, -0.5], [1.0]).shots) is None
    assert roll_off(campaign(seed, [1.0], [1.0, -1.0, 0.9]).shots) is None


def coloured(seed: int) -> Campaign:
    """Return records of an analogue amplifier: noise of two poles, sampled, and rounded."""
    rng = np.random.default_rng([seed, 7])
    finer, step = 16, 3e-5
    cutoff = float(rng.uniform(0.03, 0.6))
    b, a = butter(2, cutoff, fs=finer)
    shots = []
    for number in range(9):
        noise = lfilter(b, a, rng.normal(0.0, 1e-2, finer * SAMPLES))[::finer]
        pulse = np.exp(-(((np.arange(SAMPLES) - TRIGGER) / 10.0) ** 2))
        signal = step * np.round((pulse + noise + rng.normal(0.0, 3e-5, SAMPLES)) / step)
        shots.append(Shot(f"hit {number}", signal, RATE_HZ, TRIGGER, quantity="force_N"))
    return Campaign(tuple(shots))


@pytest.mark.parametrize("seed", range(8))
def test_noise_of_any_colour_shows_the_zeros_of_a_digital_filter(seed: int) -> None:
    """Of one pole or two; and none where the noise has its own colour alone."""
    own = coloured(seed).shots
    alone = roll_off(own)
    assert alone is None or alone.cutoff_hz is not None
    for order, form in ((1, "amplifier_lowpass"), (2, "amplifier_lowpass:second_order")):
        cutoff = float(np.random.default_rng(seed).uniform(1 / 10, 1 / 3))
        b, a = butter(order, cutoff, fs=1.0)
        behind = [dataclasses.replace(s, signal=np.asarray(lfilter(b, a, s.signal))) for s in own]
        found = roll_off([dataclasses.replace(s, signal=s.signal[50:]) for s in behind])
        assert found is not None
        assert found.cutoff_hz is not None or found.form == form


def test_it_is_told_only_where_the_model_is_far_from_the_records() -> None:
    """A model that follows the records better than their mean shows a low-pass by itself."""
    shots = build(campaign(1, *butter(1, 0.2, fs=1.0)), model_named("hsd")).shots
    assert not shown_by_records(shots)
    assert [one.effect_id for one in shown_by_records(shots, 1.0)] == ["amplifier_lowpass"]


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the shared recordings are not here")
@pytest.mark.parametrize("name", ["hammer", "board-impacts", "sphere-taps"])
def test_on_others_recordings_whose_noise_is_white(name: str) -> None:
    """None as they are; what is put in is seen."""
    shots = load_campaign(RECORDINGS / name).shots
    assert roll_off(shots) is None
    b, a = butter(1, 0.2, fs=1.0)
    behind = [dataclasses.replace(s, signal=np.asarray(lfilter(b, a, s.signal))) for s in shots]
    found = roll_off([dataclasses.replace(s, signal=s.signal[20:]) for s in behind])
    assert found is not None
    assert found.cutoff_hz == pytest.approx(0.2 * shots[0].sample_rate_hz, rel=0.2)
