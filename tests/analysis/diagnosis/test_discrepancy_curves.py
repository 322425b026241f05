"""A learned discrepancy can be looked at."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.discrepancy.fit import learn, learn_force
from analysis.diagnosis.document.discrepancy_curves import DEPTHS, discrepancy_curves


@pytest.fixture(scope="session")
def first(leaky):
    """The base model's turn."""
    return leaky.steps[0]


def test_a_linear_closure_takes_up_the_residual_of_a_leaky_coupler(first):
    """With the response family and the model fitted to each other, the worst shot is clean."""
    learned = learn(first.problem, first.fitted, [("response", "rig")])
    found = discrepancy_curves(first, learned)
    assert found["force"] is None
    (curve,) = found["shots"]
    before, left = (np.nanstd([v or np.nan for v in curve[key]]) for key in ("residual", "left"))
    assert left < before / 2


def test_each_owner_has_a_curve(first):
    """Owned by the surface, there is one shot for each of the two."""
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


def test_a_contact_closure_has_a_force(first):
    """Loading, at rest and unloading, over indentation."""
    learned = learn_force(
        first.problem, first.fitted, first.linearised, forms=("elastic", "rate"), scope="rig"
    )
    found = discrepancy_curves(first, learned)
    (curve,) = found["force"]["curves"]
    assert [len(share) for share in curve["share"]] == [DEPTHS.size] * 3
