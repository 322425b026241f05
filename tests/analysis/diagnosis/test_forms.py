"""Two forms of one law that the data do not tell apart: the numbers' intervals hold for both."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from analysis.diagnosing import diagnose
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.forms import best_form
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Scope
from tests.analysis.diagnosis import test_groupings
from tests.analysis.diagnosis.test_mistakes import campaign

GAMMA, NAME = 0.8, "surface_energy_j_per_m2"


@pytest.fixture(scope="module")
def sticky(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """The diagnosis of 54 drops under the law of Johnson, Kendall and Roberts."""
    effect = make_effect("adhesion", {NAME: GAMMA}, form="jkr")
    return diagnose(campaign(tmp_path_factory.mktemp("sticky"), effect))


@pytest.mark.slow
def test_the_numbers_of_an_effect_hold_for_each_form(sticky: dict[str, Any]) -> None:
    """A constant pull of half the surface energy gives about the same traces."""
    (effect,) = sticky["effects"]
    low, high = effect["parameters"][NAME]["interval95"]
    assert effect["id"] == "adhesion"
    assert {effect["form"], *effect["forms_as_good"]} == {"adhesion", "adhesion:jkr"}
    assert low < 0.75 * GAMMA
    assert low < GAMMA < high


@pytest.mark.slow
def test_the_sentence_says_which_forms_are_not_told_apart(sticky: dict[str, Any]) -> None:
    """One of them is in the model, and the moduli are those of that model."""
    assert "These data do not distinguish the form adhesion" in sticky["sentence"]


@pytest.mark.slow
def test_a_form_that_is_told_apart_stands_alone(tmp_path: Path) -> None:
    """A strong roll-off of one pole is none of six."""
    found = diagnose(
        campaign(tmp_path, make_effect("amplifier_lowpass", {"cutoff_hz": 4e4, "filter_order": 1}))
    )
    (effect,) = found["effects"]
    assert effect["id"] == "amplifier_lowpass"
    assert effect["forms_as_good"] == []


def test_a_rare_form_is_asked_where_the_usual_one_explains_nearly_all(tmp_path: Path) -> None:
    """Three arms a decade apart are no single arm. Where it explains half, nobody asks."""
    name, values = "stress_relaxation", {"strength": 0.15, "relaxation_time_s": 7e-6}
    drawn = test_groupings.campaign(tmp_path, name, Scope(), form="maxwell", **values)
    problem, base, found = test_groupings.with_one_size(drawn, name)
    better = best_form(problem, base, found)
    assert better.effect.by_name
    assert better.score() > found.score() + CRITERIA.least_lead
    missing = base.cost - sum(item.expected_squares for item in problem.shots)
    half = dataclasses.replace(found, gain=0.5 * missing)
    assert not best_form(problem, base, half).effect.by_name


@pytest.mark.slow
def test_asperities_in_series_are_named_with_their_height(tmp_path: Path) -> None:
    """A softer toe than the usual form of roughness has: a logarithm of the force."""
    height = 5e-7
    rough = make_effect("surface_roughness", {"roughness_m": height}, form="series")
    found = diagnose(campaign(tmp_path, rough))
    (effect,) = found["effects"]
    assert (found["verdict"], effect["form"]) == ("identified", "surface_roughness:layer")
    heights = {k: v for k, v in effect["parameters"].items() if k.startswith("roughness_m")}
    for number in heights.values():
        low, high = number["interval95"]
        assert low < height < high, heights
