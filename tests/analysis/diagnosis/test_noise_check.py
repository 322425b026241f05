"""Spikes and tones that no impact causes are told from noise, and noise of any colour is noise."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.noise_check import Spikes, check_noise
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.fit.problem import FitShot, build
from analysis.model.impact_model import model_named
from analysis.noise import estimate_noise
from drivers.simulated.noise import NoiseSettings, noise_table

from .conftest import small_campaign

Array = NDArray[np.float64]
SAMPLES = 1500


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[FitShot]:
    """Eight shots, to be given other samples before the trigger."""
    return build(small_campaign(tmp_path_factory.mktemp("quiet")), model_named("kv2")).shots


def _with_quiet(shots: Sequence[FitShot], quiet: Sequence[Array]) -> list[FitShot]:
    """Return the shots with other samples, a clear pulse behind them."""
    noise = estimate_noise(quiet)
    assert noise is not None
    pulse = 100.0 * max(np.std(samples) for samples in quiet) * np.sin(np.linspace(0, np.pi, 100))
    given = []
    for item, samples in zip(shots, quiet, strict=False):
        signal = np.concatenate([samples, pulse, np.zeros(2000)])
        shot = dataclasses.replace(item.shot, signal=signal, trigger_index=samples.size + 5)
        given.append(dataclasses.replace(item, shot=shot, noise=noise))
    return given


def _noise(rng: np.random.Generator, colour: float = 0.0) -> Array:
    return np.asarray(lfilter([1.0], [1.0, -colour], rng.standard_normal(SAMPLES)))


@pytest.mark.parametrize("colour", [0.0, 0.3, 0.6])
def test_gaussian_noise_of_any_colour_is_noise(shots: list[FitShot], colour: float) -> None:
    """Its fourth moment is what theory says, to within its standard error."""
    rng = np.random.default_rng(1)
    seen = check_noise(_with_quiet(shots, [_noise(rng, colour) for _ in shots])).spikes
    assert not seen.clear
    assert abs(seen.excess_kurtosis) < 4 * np.sqrt(24 / seen.samples)


def test_records_of_different_levels_are_no_spikes(shots: list[FitShot]) -> None:
    """A record ten times as noisy as the others is measured by itself."""
    rng = np.random.default_rng(2)
    levels = [10.0, *([1.0] * (len(shots) - 1))]
    assert not check_noise(
        _with_quiet(shots, [level * _noise(rng) for level in levels])
    ).spikes.clear


@pytest.mark.parametrize("step", [1.3, 3.0, 6.0])
def test_a_coarse_converter_makes_no_spikes(shots: list[FitShot], step: float) -> None:
    """Rare single steps are what a converter leaves of a small noise."""
    rng = np.random.default_rng(3)
    assert not check_noise(
        _with_quiet(shots, [step * np.round(_noise(rng) / step) for _ in shots])
    ).spikes.clear


def test_spikes_are_counted(shots: list[FitShot]) -> None:
    """Three spikes of ten deviations a record are seen, and nearly all of them counted."""
    rng = np.random.default_rng(4)
    quiet = [_noise(rng) for _ in shots]
    for samples in quiet:
        samples[rng.choice(SAMPLES - 100, 3, replace=False)] += 10.0
    seen = check_noise(_with_quiet(shots, quiet)).spikes
    assert seen.clear
    assert seen.p_value < 1e-9
    assert 2.5 * len(shots) < seen.far <= 3 * len(shots)
    assert seen.share == pytest.approx(3 * 100 / (SAMPLES + 3 * 100), rel=0.1)


@pytest.mark.parametrize("size", [0.3, 1.0, 30.0])
@pytest.mark.parametrize("frequency_hz", [3e3, 2e4, 3e5])
def test_a_tone_is_heard(shots: list[FitShot], size: float, frequency_hz: float) -> None:
    """From far below the noise to far above it, where the noise is taken for coloured."""
    rng = np.random.default_rng(5)
    turn = 2 * np.pi * frequency_hz * 1e-6 * np.arange(SAMPLES)
    quiet = [_noise(rng) + size * np.sin(turn + rng.uniform(0, 7)) for _ in range(8)]
    tone = check_noise(_with_quiet(shots, quiet)).tone
    assert tone is not None
    assert tone.frequency_hz == pytest.approx(frequency_hz, abs=1e6 / SAMPLES)
    assert tone.clear
    power = size**2 / 2
    if size <= 1.0:  # a louder one is in part taken for colour
        assert tone.share == pytest.approx(power / (1 + power), rel=0.4)


@pytest.mark.parametrize("colour", [0.0, 0.6])
def test_noise_and_hum_are_no_tone(shots: list[FitShot], colour: float) -> None:
    """Hum is an effect of the library, and slower than the slowest line."""
    rng = np.random.default_rng(6)
    turn = 2 * np.pi * 150.0 * 1e-6 * np.arange(SAMPLES)
    quiet = [_noise(rng, colour) + 20 * np.sin(turn + rng.uniform(0, 7)) for _ in range(8)]
    tone = check_noise(_with_quiet(shots, quiet)).tone
    assert tone is not None
    assert tone.p_value > 1e-4


@pytest.mark.slow
def test_slow_noise_of_long_records_is_no_tone(shots: list[FitShot]) -> None:
    """Where hum is taken off, lines are short; beside them noise of 1/f must not stand out."""
    settings = NoiseSettings(1.0, pink_corner_hz=300.0)
    for seed in range(6):
        table = noise_table(settings, 52 * 20_000, 1e6, np.random.default_rng(seed))
        quiet = list(table.astype(np.float64).reshape(52, 20_000))
        tone = check_noise(_with_quiet(shots * 7, quiet)).tone
        assert tone is not None
        assert tone.p_value > 1e-4


def test_records_that_share_noise_make_no_tone(shots: list[FitShot]) -> None:
    """Eight records of which each two are the same: a line is as high by chance as of four."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        four = [_noise(rng) for _ in range(4)]
        tone = check_noise(_with_quiet(shots, four + four)).tone
        assert tone is not None
        assert tone.p_value > 1e-4


def test_without_quiet_samples_nothing_is_said(shots: list[FitShot]) -> None:
    """Too few samples are no linearisation of anything."""
    assert not check_noise([]).clear
    assert not Spikes(1999, 50, 90.0, 0.1).clear
    assert Spikes(0, 0, 0.0, 0.0).p_value == 1.0


def test_a_rig_with_spikes_ends_as_unknown_in_the_electronics(tmp_path: Path) -> None:
    """Nothing repeats from shot to shot, yet it is not called noise, and nothing is named."""
    campaign = small_campaign(tmp_path, "x_glitches", amplitude_v=0.1, rate_hz=2000.0)
    found = diagnosis_json(diagnose_campaign(campaign), software="impactd test")
    assert (found["verdict"], found["slot"], found["effects"]) == ("unknown", "electronics", [])
    assert "spikes" in found["sentence"]
    assert found["noise"]["background"]["spikes"]["clear"]
    assert found["remaining"]["structured"]
    assert found["p_value"] < 1e-6
    json.dumps(found, allow_nan=False)


def test_what_is_on_the_line_anyway_is_given_no_name(tmp_path: Path) -> None:
    """A coil that rings behind the valve looks like a resonance in the windows."""
    values = {"amplitude_v": 0.02, "frequency_hz": 4000.0, "decay_s": 0.2}
    campaign = small_campaign(tmp_path, "x_microphonic_cable", **values)
    found = diagnosis_json(diagnose_campaign(campaign), software="impactd test")
    assert (found["verdict"], found["slot"], found["effects"]) == ("unknown", "electronics", [])
    assert "tone" in found["sentence"]
