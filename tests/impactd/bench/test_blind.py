"""The blind trials: what is drawn, what is counted."""

from __future__ import annotations

import dataclasses

import pytest

from impactd.bench import blind

BASE = blind.Trial(
    seed=1,
    kind="library",
    truth=["echo"],
    slots=["electronics"],
    ar1=0.3,
    verdict="identified",
    named=["echo"],
    confusable=[],
    slot="electronics",
    p_value=0.0,
    visible=1e4,
    noise_ratio=1.0,
    seconds=1.0,
)


def test_a_name_among_confusable_ones_counts_as_the_right_family() -> None:
    """The truth may stand in the confusion set; a certain other name is wrong."""
    family = dataclasses.replace(BASE, verdict="family", named=["second_mode"], confusable=["echo"])
    assert blind.right(family)
    assert not blind.wrong(family)
    other = dataclasses.replace(BASE, named=["second_mode"])
    assert blind.wrong(other)
    assert not blind.right(other)


def test_shares_are_counted_by_kind_and_visibility() -> None:
    """Invisible effects count in no share; goals are judged."""
    hidden = dataclasses.replace(BASE, verdict="adequate", named=[], visible=1.0)
    figures = {f.name: f for f in blind.summary([BASE, hidden])}
    assert figures["single effects: right name or family (1)"].value == 1.0
    assert figures["single effects: wrong name (1)"].met


@pytest.mark.slow
def test_a_trial_knows_both_sides() -> None:
    """A trial's truth comes from the simulator, its verdict from the analysis."""
    found = blind.trial(90_001)
    assert found.verdict in (
        "adequate",
        "identified",
        "family",
        "partial",
        "unknown",
        "not_identifiable",
    )
    assert (found.kind == "clean") == (not found.truth)
