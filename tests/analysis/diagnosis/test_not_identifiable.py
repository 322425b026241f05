"""Campaigns that cannot tell the moduli that were sought: said, and the rest is diagnosed still."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.campaign import Campaign, Sensor
from analysis.diagnosing import diagnose

from .conftest import small_campaign

Change = Callable[[Campaign], Campaign]


def _without_reference(campaign: Campaign) -> Campaign:
    """Return a campaign in which no material's modulus is stated."""
    return dataclasses.replace(
        campaign,
        spheres={
            n: dataclasses.replace(s, youngs_modulus_pa=None) for n, s in campaign.spheres.items()
        },
        surfaces={
            n: dataclasses.replace(s, youngs_modulus_pa=None) for n, s in campaign.surfaces.items()
        },
    )


def _without_gain(campaign: Campaign) -> Campaign:
    """Return a campaign with neither certificate nor heights."""
    shots = tuple(dataclasses.replace(s, drop_height_m=None) for s in campaign.shots)
    return dataclasses.replace(campaign, shots=shots, sensor=Sensor())


@pytest.mark.parametrize(
    ("change", "missing", "add"),
    [
        (_without_reference, "reference", "State the modulus of"),
        (_without_gain, "gain", "or the drop heights"),
    ],
)
def test_a_sound_model_that_tells_no_modulus_is_not_identifiable(
    tmp_path: Path, change: Change, missing: str, add: str
) -> None:
    """The verdict, the sentence and the withheld modulus say what is missing and what to add."""
    found = diagnose(change(small_campaign(tmp_path)))
    assert found["verdict"] == "not_identifiable"
    assert {one["missing"] for one in found["undetermined"]} == {missing}
    assert "specimen" in {one["material"] for one in found["undetermined"]}
    assert add in found["sentence"]
    for block in (found["before"], found["after"]):
        assert block["moduli"]["specimen"]["status"] == "withheld"
        assert add in block["moduli"]["specimen"]["reason"]


@pytest.mark.slow
def test_what_else_the_drops_show_is_found_all_the_same(tmp_path: Path) -> None:
    """A leaky coupler is named although no modulus can be told, and the sentence says both."""
    leaky = small_campaign(tmp_path, "coupler_highpass", time_constant_s=5e-3)
    said: list[str] = []
    found = diagnose(_without_reference(leaky), progress=lambda stage, share: said.append(stage))
    assert found["verdict"] == "identified"
    assert [one["id"] for one in found["effects"]] == ["coupler_highpass"]
    assert "specimen" in {one["material"] for one in found["undetermined"]}
    assert "cannot be told from these drops" in found["sentence"]
    assert found["after"]["moduli"]["specimen"]["status"] == "withheld"
    (told,) = [stage for stage in said if "no modulus" in stage]
    searched = next(i for i, words in enumerate(said) if words.startswith("Candidates"))
    assert said.index(told) < searched
