"""Structure inside single shots: an effect's is, that of a mistake or of an odd shot is not."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.campaign import Campaign
from analysis.diagnosis.base_choice import fitted_base
from analysis.diagnosis.each_alone import is_inside_shots
from analysis.diagnosis.progress import Watch
from drivers.simulated.effects import make_effect
from tests.analysis.diagnosis.test_mistakes import (
    amplified,
    campaign,
    with_height,
    with_mass,
    with_modulus,
)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    """Three spheres on three surfaces; nothing acts, and all is written down as it was."""
    return campaign(tmp_path_factory.mktemp("clean"))


def inside(whole: Campaign) -> bool:
    """Return what is said of a campaign, of which the base leaves more than noise."""
    selection, usual = fitted_base(whole, "kv2", Watch())
    assert not selection.adequate
    return is_inside_shots(selection.last, usual)


def relabelled(whole: Campaign) -> Campaign:
    """Return a campaign in which all shots of two spheres have each other's name."""
    other = {"acetal": "acetal_small", "acetal_small": "acetal"}
    shots = (
        dataclasses.replace(s, sphere=other.get(s.sphere or "", s.sphere)) for s in whole.shots
    )
    return dataclasses.replace(whole, shots=tuple(shots))


@pytest.mark.parametrize(
    "mistaken",
    [
        lambda whole: with_mass(whole, 1.3),
        lambda whole: with_height(whole, 2.0),
        lambda whole: with_modulus(whole, 2.0),
        lambda whole: amplified(whole, lambda place: 2.0 if place > 20 else 1.0),  # noise too
        relabelled,
    ],
    ids=["mass", "height", "modulus", "gain", "labels"],
)
def test_a_mistake_is_not(mistaken: Callable[[Campaign], Campaign], clean: Campaign) -> None:
    """However gross: one shot with numbers of its own still obeys the law."""
    assert not inside(mistaken(clean))


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("coupler_highpass", {"time_constant_s": 5e-3}),
        ("clipping", {"limit_v": 1.0, "softness": 0.1}),
        ("base_compliance", {"frequency_hz": 4e3, "damping_ratio": 0.05, "base_mass_kg": 3.0}),
    ],
)
def test_a_strong_effect_is(effect: str, values: dict[str, float], tmp_path: Path) -> None:
    """No number of the base model follows it, whoever's it is."""
    assert inside(campaign(tmp_path, make_effect(effect, values)))
