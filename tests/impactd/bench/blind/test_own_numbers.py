"""Whether an effect's own numbers hold the truth, and of which trials that is asked."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest

from analysis.effects.library import library
from drivers.simulated.effects import LIBRARY
from impactd.bench.blind.own_numbers import NO_TRUTH, stated_numbers
from impactd.bench.blind.questions import answers
from impactd.bench.blind.trial import Trial
from impactd.demo.sealed_effects import LIBRARY_NAMES

ATrial = Callable[..., Trial]
Json = dict[str, Any]


def _echo(a_trial: ATrial, delay: list[float | None], **more: Any) -> Trial:
    """Return a trial with an echo of 20 us, named with this interval of its delay."""
    effect = {"id": "echo", "slot": "electronics", "form": ""}
    numbers = {"delay_s": 2e-5, "ratio": 0.1}
    said: Json = {"strength": {"interval95": [0.11, 0.12]}, "delay_s": {"interval95": delay}}
    told = {"named": ["echo"], "acts_on": [{}], "numbers": [said]}
    return a_trial(effects=[effect | {"parameters": numbers}], **(told | more))


def test_a_number_holds_or_does_not(a_trial: ATrial) -> None:
    """Each number counts by itself; an open end is no limit."""
    trials = [_echo(a_trial, [1.9e-5, 2.1e-5]), _echo(a_trial, [None, 1.8e-5])]
    strength, delay = stated_numbers(trials[0])
    assert (strength.holds, delay.holds) == (False, True)
    assert stated_numbers(trials[1])[1].low == -math.inf
    asked = {a.question: a for a in answers(trials)}
    whole = asked["an effect's own numbers: 95 % interval covers"]
    assert (whole.count, whole.value) == (4, 0.25)


@pytest.mark.parametrize(
    "more",
    [
        {"named": ["second_mode"]},
        {"acts_on": [{"surface": "specimen"}]},
        {"numbers": []},  # of lines that were written before it was asked
        {"verdict": "unknown"},
    ],
)
def test_nothing_is_asked_where_the_name_or_the_place_is_another(
    a_trial: ATrial, more: Json
) -> None:
    """Such numbers are of something else."""
    assert stated_numbers(_echo(a_trial, [1.9e-5, 2.1e-5], **more)) == []


def test_numbers_of_another_law_mean_something_else(a_trial: ATrial) -> None:
    """A loss factor's layer has no viscosity."""
    effect = {"id": "adhesive_layer", "slot": "mounting", "form": "loss_factor"}
    effect["parameters"] = {"stiffness_n_per_m": 1e9}  # type: ignore[assignment]
    said = [{"stiffness_n_per_m": {"interval95": [0.9e9, 1.1e9]}}]
    told = {"effects": [effect], "named": ["adhesive_layer"], "acts_on": [{}], "numbers": said}
    assert stated_numbers(a_trial(**told)) == []


def test_every_number_of_the_library_has_a_truth_or_is_known_to_have_none() -> None:
    """A name that the simulator spells differently would never be compared."""
    for effect_id, kind in LIBRARY.items():
        theirs = {LIBRARY_NAMES.get((effect_id, p.name), p.name) for p in kind.parameters}
        ours = {p.name for p in library()[effect_id].parameters}
        assert ours - theirs == NO_TRUTH.get(effect_id, set()), effect_id
