"""How one trial is judged."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from impactd.bench.blind.outcome import is_detectable, names_all, outcome
from impactd.bench.blind.trial import Trial

ATrial = Callable[..., Trial]


@pytest.mark.parametrize(
    ("truth", "said", "judged"),
    [
        (["echo"], {"named": ["echo"]}, "right"),
        (["echo"], {"named": ["echo"], "verdict": "partial"}, "right"),
        (["echo"], {"named": ["clipping"]}, "wrong"),
        (["echo"], {"named": ["echo", "clipping"]}, "wrong"),
        (["echo"], {"verdict": "unknown"}, "unknown"),
        (["echo"], {"verdict": "adequate"}, "missed"),
        (["echo"], {"verdict": "failed"}, "failed"),
        ([], {"verdict": "adequate"}, "adequate"),
        ([], {"named": ["echo"]}, "wrong"),
        (["echo", "adhesion"], {"named": ["adhesion", "echo"]}, "right"),
        (["echo", "adhesion"], {"named": ["echo"], "verdict": "partial"}, "half"),
    ],
)
def test_a_trial_has_one_outcome(
    a_trial: ATrial, truth: list[str], said: dict[str, Any], judged: str
) -> None:
    """All named, some named, something false, nothing said: each is counted once."""
    assert outcome(a_trial(*truth, **said)) == judged


def test_a_confusion_set_that_holds_the_truth_is_the_right_family(a_trial: ATrial) -> None:
    """It was said that it could be either; a set without the truth is a wrong name."""
    family = {"verdict": "family", "named": ["second_mode"], "confusable": [["echo"]]}
    assert outcome(a_trial("echo", **family)) == "family"
    assert outcome(a_trial("adhesion", **family)) == "wrong"


@pytest.mark.parametrize(
    ("could_also_be", "judged"), [([["echo"], []], "wrong"), ([[], ["echo"]], "family")]
)
def test_each_name_of_a_pair_has_a_confusion_set_of_its_own(
    a_trial: ATrial, could_also_be: list[list[str]], judged: str
) -> None:
    """A set says nothing of the other name."""
    said = {"named": ["adhesion", "second_mode"], "confusable": could_also_be}
    assert outcome(a_trial("adhesion", "echo", **said)) == judged


def test_a_name_too_many_does_not_hide_that_all_were_named(a_trial: ATrial) -> None:
    """Both are counted, each in its own row."""
    trial = a_trial("echo", "adhesion", named=["echo", "adhesion", "clipping"])
    assert names_all(trial)
    assert outcome(trial) == "wrong"


def test_a_missing_crystal_is_the_truth_of_the_base_without_one(a_trial: ATrial) -> None:
    """Nothing acts, and yet something is to be found."""
    assert outcome(a_trial(base="hsd", named=["crystal_dynamics"])) == "right"
    assert outcome(a_trial(base="hsd", verdict="adequate")) == "missed"


def test_a_pair_is_detectable_when_each_of_it_is(a_trial: ATrial) -> None:
    """A large effect lends nothing to a small one."""
    assert is_detectable(a_trial("echo", "adhesion", visible=9e4, visible_each=[9e4, 500.0]))
    assert not is_detectable(a_trial("echo", "adhesion", visible=9e4, visible_each=[9e4, 300.0]))
    assert not is_detectable(a_trial())
