"""A converter of few bits on an otherwise right rig is no discrepancy, and the words say so."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.document.diagnosis_json import diagnosis_json
from analysis.diagnosis.procedure import diagnose_campaign
from analysis.fit.fit_shot import noise_by_instrument
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.noise import NoiseSettings
from impactd.storage.campaign_folder import read_campaign


def campaign(folder: Path, bits: int, noise: NoiseSettings | None = None) -> Campaign:
    """Return eight shots through a converter of so many bits."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        bits=bits,
        noise=noise or usual.noise,
    )
    return read_campaign(write_campaign_folder(folder, simulate_campaign(settings, 2)))


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_few_bits_are_adequate_and_said_to_limit(tmp_path: Path, bits: int) -> None:
    """Rounding is taken for noise: no structure, and a person is told what limits."""
    found = diagnosis_json(diagnose_campaign(campaign(tmp_path, bits)), software="impactd test")
    assert found["verdict"] == "adequate"
    assert found["p_value"] > 1e-2
    assert "quantisation limits" in found["sentence"]
    assert found["noise"]["said"][0].startswith("Quantisation limits: the converter's step is")
    (instrument,) = found["noise"]["instruments"]
    assert instrument["kind"] == "quantisation"
    assert instrument["converter_step"] == 20.0 / 2**bits


def test_slow_noise_behind_few_bits_is_noise(tmp_path: Path) -> None:
    """A third of a step of it moves codes, and its slow part shows: it is no hum."""
    slow = NoiseSettings(rms_v=1.9e-3, pink_corner_hz=2e4)
    found = diagnose_campaign(campaign(tmp_path, 12, slow))
    assert found.verdict == "adequate"
    noise = found.steps[0].problem.shots[0].noise
    assert noise.coarse is not None
    assert 1e-2 < noise.corner < 4e-2


def test_sixteen_bits_hide_nothing(tmp_path: Path) -> None:
    """A step of a fifth of the noise is white noise, and every sample counts."""
    found = diagnose_campaign(campaign(tmp_path, 16))
    for shot in found.steps[0].problem.shots:
        assert shot.noise.coarse is None
        assert shot.expected_squares == shot.frame.samples - shot.noise.history
        values = shot.window.signal
        assert (shot.whiten(values) == shot.noise.whiten(values)).all()


def test_the_step_is_found_where_it_is_not_stated(tmp_path: Path) -> None:
    """Eight bits kept as sixteen, or as volts without a step, are eight bits."""
    stated = campaign(tmp_path, 8)
    for quantum in (None, 20.0 / 65536):
        shots = tuple(dataclasses.replace(s, quantum=quantum) for s in stated.shots)
        (noise,) = noise_by_instrument(shots).values()
        assert noise.coarse is not None
        assert noise.coarse.step == pytest.approx(20.0 / 256, rel=1e-9)
