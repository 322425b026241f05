"""What a person is told about a residual is what it does, and what a discrepancy adds to it."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from analysis.diagnosis.discrepancy.fit import learn, learn_force, on_top
from analysis.diagnosis.document.residual import (
    DEPTHS,
    bin_edges_us,
    binned,
    describe,
    discrepancy_curves,
    mean_in_bins,
)
from analysis.diagnosis.held_out import as_fit_result


@pytest.fixture(scope="session")
def leaky_before(leaky):
    """The base model's fit of the leaky campaign."""
    return as_fit_result(leaky.steps[0].problem, leaky.steps[0].fitted)


@pytest.fixture(scope="session")
def leaky_after(leaky):
    """The repaired fit."""
    return as_fit_result(leaky.steps[-1].problem, leaky.steps[-1].fitted)


def test_a_slow_leak_is_seen_after_the_pulse_at_low_frequency(leaky_before):
    """The undershoot of a high-pass is after the contact, slow, and grows like the pulse."""
    found = describe(leaky_before, structured=True)
    ratio = {name: phase["chi2_per_sample"] for name, phase in found["phases"].items()}
    assert max(ratio["ring"], ratio["later"]) > 2
    assert ratio["before"] == pytest.approx(1.0, abs=0.3)
    assert found["spectrum"]["peak_Hz"] < 5e3
    assert found["speed"]["exponent"] == pytest.approx(1.0, abs=0.3)
    json.dumps(found, allow_nan=False)


def test_noise_is_called_noise(leaky_after):
    """After the repair one sentence is left."""
    (sentence,) = describe(leaky_after, structured=False)["said"]
    assert "noise" in sentence


def test_structure_as_small_as_noise_is_not_called_noise(leaky_after):
    """What the tests find is not taken back by the description."""
    said = " ".join(describe(leaky_after, structured=True)["said"])
    assert "the residual is noise" not in said
    assert "the tests find structure in it" in said


def test_stacks_cover_every_pair_and_height_once(leaky_before):
    """Eight shots at two heights on four pairs make eight curves over one time axis."""
    stacks = describe(leaky_before, structured=True)["stacks"]
    curves = stacks["by_pair_and_height"]
    assert len(curves) == 8
    assert sum(curve["shots"] for curve in curves) == 8
    assert {len(curve["mean"]) for curve in curves} == {len(stacks["time_us"])}
    assert sum(part["shots"] for part in stacks["by_order"]) == 8


def test_bins_lose_no_sample_after_touch_down(leaky_before):
    """Every sample from well before touch-down to the window's end is in exactly one bin."""
    edges_us = bin_edges_us(leaky_before.shots)
    for shot in leaky_before.shots:
        sums, counts = binned(edges_us, shot, np.ones(shot.residual.size))
        assert np.array_equal(sums, counts)
        assert counts.sum() >= 0.8 * shot.residual.size


def test_the_stack_of_one_shot_is_its_residual(leaky_before):
    """Where bins are as fine as samples, the mean of one shot is the shot."""
    shot = leaky_before.shots[0]
    mean = mean_in_bins(bin_edges_us([shot]), [shot], [shot.residual])
    assert np.nanmax(np.abs(mean)) <= np.abs(shot.residual).max() * (1 + 1e-12)
    assert np.nansum(mean**2) > 0


@pytest.fixture(scope="session")
def first(leaky):
    """The base model's turn."""
    return leaky.steps[0]


def test_a_linear_discrepancy_takes_up_the_residual_of_a_leaky_coupler(first):
    """With the response family and the model fitted to each other, the worst shot is clean."""
    learned = learn(first.problem, first.fitted, [("response", "rig")])
    found = discrepancy_curves(first, learned)
    assert found["force"] is None
    (curve,) = found["shots"]
    before, left = (np.nanstd([v or np.nan for v in curve[key]]) for key in ("residual", "left"))
    assert left < before / 2


def test_each_group_has_a_curve(first):
    """By surface, there is one shot for each of the two."""
    learned = learn(first.problem, first.fitted, [("response", "surface")])
    found = discrepancy_curves(first, learned)
    assert sorted(shot["owner"] for shot in found["shots"]) == ["aluminium", "specimen"]


def test_of_numbers_that_are_every_shots_own_each_pair_has_a_curve(first):
    """The shot that gets most."""
    learned = learn(first.problem, first.fitted, [("gain", "shot")])
    found = discrepancy_curves(first, learned)
    pairs = {shot.pair for shot in first.problem.shots}
    assert sorted(shot["pair"] for shot in found["shots"]) == sorted(pairs)
    sizes = [float(np.mean(np.square(a))) for a in learned.added]
    names = [shot.shot.name for shot in first.problem.shots]
    assert names[int(np.argmax(sizes))] in {shot["shot"] for shot in found["shots"]}


def test_a_contact_discrepancy_has_a_force(first):
    """Loading, at rest and unloading, over indentation."""
    learned = learn_force(
        first.problem, first.fitted, first.linearised, forms=("elastic", "rate"), scope="rig"
    )
    found = discrepancy_curves(first, learned)
    (curve,) = found["force"]["curves"]
    assert [len(share) for share in curve["share"]] == [DEPTHS.size] * 3


def test_a_force_keeps_its_curve_beside_what_was_learned_on_top_by_surface(first):
    """Groups are the force's own: those of the second part are no force."""
    force = learn_force(first.problem, first.fitted, first.linearised, forms=("rate",), scope="rig")
    alone = discrepancy_curves(first, force)["force"]
    second = learn(force.problem, force.fitted, [("gain", "surface")])
    both = on_top(force, dataclasses.replace(second, fitted=force.fitted))
    assert discrepancy_curves(first, both)["force"] == alone
