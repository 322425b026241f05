"""Spikes that no impact causes are told from noise, and noise of any level and colour is not."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.discovery.diagnosis import diagnose_campaign
from analysis.discovery.spikes import Spikes, spikes
from analysis.discovery.statement import diagnosis_json
from analysis.fit.problem import FitShot, build
from analysis.model.impact_model import model_named
from analysis.noise import estimate_noise

from .conftest import small_campaign

Array = NDArray[np.float64]
SAMPLES = 1500


@pytest.fixture(scope="module")
def shots(tmp_path_factory: pytest.TempPathFactory) -> list[FitShot]:
    """Eight shots, to be given other samples before the trigger."""
    return build(small_campaign(tmp_path_factory.mktemp("quiet")), model_named("kv")).shots


def _with_quiet(shots: Sequence[FitShot], quiet: Sequence[Array]) -> list[FitShot]:
    """Return the shots with other samples, a clear pulse behind them."""
    noise = estimate_noise(quiet)
    assert noise is not None
    pulse = 100.0 * np.sin(np.linspace(0, np.pi, 100))
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
    seen = spikes(_with_quiet(shots, [_noise(rng, colour) for _ in shots]))
    assert not seen.clear
    assert abs(seen.excess_kurtosis) < 4 * np.sqrt(24 / seen.samples)


def test_records_of_different_levels_are_no_spikes(shots: list[FitShot]) -> None:
    """A record ten times as noisy as the others is measured by itself."""
    rng = np.random.default_rng(2)
    levels = [10.0, *([1.0] * (len(shots) - 1))]
    assert not spikes(_with_quiet(shots, [level * _noise(rng) for level in levels])).clear


@pytest.mark.parametrize("step", [1.3, 3.0, 6.0])
def test_a_coarse_converter_makes_no_spikes(shots: list[FitShot], step: float) -> None:
    """Rare single steps are what a converter leaves of a small noise."""
    rng = np.random.default_rng(3)
    assert not spikes(_with_quiet(shots, [step * np.round(_noise(rng) / step) for _ in shots])).clear


def test_spikes_are_counted(shots: list[FitShot]) -> None:
    """Three spikes of ten deviations a record are seen, and nearly all of them counted."""
    rng = np.random.default_rng(4)
    quiet = [_noise(rng) for _ in shots]
    for samples in quiet:
        samples[rng.choice(SAMPLES - 100, 3, replace=False)] += 10.0
    seen = spikes(_with_quiet(shots, quiet))
    assert seen.clear
    assert seen.p_value < 1e-9
    assert 2.5 * len(shots) < seen.far <= 3 * len(shots)


def test_without_quiet_samples_nothing_is_said(shots: list[FitShot]) -> None:
    """Too few samples are no evidence of anything."""
    assert not spikes([]).clear
    assert not Spikes(1999, 50, 90.0).clear
    assert Spikes(0, 0, 0.0).p_value == 1.0


def test_a_rig_with_spikes_ends_as_unknown_in_the_electronics(tmp_path: Path) -> None:
    """Nothing repeats from shot to shot, yet it is not called noise, and nothing is named."""
    campaign = small_campaign(tmp_path, "x_glitches", amplitude_v=0.1, rate_hz=2000.0)
    found = diagnosis_json(diagnose_campaign(campaign), software="impactd test")
    assert (found["verdict"], found["slot"], found["effects"]) == ("unknown", "electronics", [])
    assert "spikes" in found["sentence"]
    assert found["noise"]["spikes"]["clear"]
    assert found["remaining"]["structured"]
    assert found["p_value"] < 1e-6
    json.dumps(found, allow_nan=False)
