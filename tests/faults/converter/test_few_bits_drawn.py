"""Whole campaigns through converters of few bits, drawn again and again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.diagnosis.procedure import diagnose_campaign
from analysis.diagnosis.selection import Step
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from impactd.storage.campaign_folder import read_campaign

SEEDS = range(1, 21)

pytestmark = pytest.mark.slow


def few_drops(bits: int, rig: str, *effects: Effect) -> CampaignSettings:
    """Return the settings of eight drops."""
    usual = CampaignSettings()
    return dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        bits=bits,
        rig=rig,
        effects=effects,
    )


@pytest.mark.parametrize("bits", [8, 10, 12])
@pytest.mark.parametrize(("rig", "base"), [("paper", "kv"), ("closed", "kv2")])
def test_no_draw_of_a_right_rig_has_structure(
    tmp_path: Path, bits: int, rig: str, base: str
) -> None:
    """Of twenty campaigns none has a p-value below 1e-3, and at most six are below 0.1."""
    settings = few_drops(bits, rig)
    found = []
    for seed in SEEDS:
        folder = write_campaign_folder(tmp_path / str(seed), simulate_campaign(settings, seed))
        problem, nuisances = with_start(build(read_campaign(folder), model_named(base)))
        found.append(Step(problem, joint.fit(problem, nuisances)).score_test.p_value)
    assert min(found) > 1e-3
    # chance leaves 2 of them, and 7 or more once in 400 times
    assert sum(p < 0.1 for p in found) < 7


def test_eight_bits_still_name_an_effect(tmp_path: Path) -> None:
    """A coupler of 2 ms is named through a converter of 8 bits, and what it leaves is noise."""
    leaky = make_effect("coupler_highpass", {"time_constant_s": 2e-3})
    folder = write_campaign_folder(tmp_path, simulate_campaign(few_drops(8, "paper", leaky), 3))
    found = diagnose_campaign(read_campaign(folder), "kv")
    assert found.verdict == "identified"
    (effect,) = found.chosen
    assert effect.effect_id == "coupler_highpass"
