"""A learned discrepancy repairs shots that it was not learned on."""

from __future__ import annotations

import numpy as np

from analysis.diagnosis.discrepancy.fit import learn, learn_force, on_top
from analysis.fit.campaign_fit import heldout_rms


def test_the_error_on_held_out_shots_falls(leaky):
    """What a leaky coupler does is a linear chain's doing, at every height."""
    first = leaky.steps[0]
    before = heldout_rms(first.problem, first.fitted)
    learned = learn(first.problem, first.fitted, [("response", "rig")])
    assert learned.heldout_rms < before / 2
    assert learned.rms <= learned.heldout_rms


def test_numbers_of_single_shots_repair_held_out_shots_too(leaky):
    """They are fitted to a held-out shot as its speed and touch-down are."""
    first = leaky.steps[0]
    before = heldout_rms(first.problem, first.fitted)
    learned = learn(first.problem, first.fitted, [("gain", "shot")])
    assert learned.heldout_rms < before
    assert learned.coefficients == {}


def test_a_closure_beside_a_force_is_one_with_it(leaky):
    """Parts, coefficients and what both add are those of the two together."""
    first = leaky.steps[0]
    force = learn_force(
        first.problem, first.fitted, first.linearised, forms=("elastic",), scope="rig"
    )
    more = on_top(force, learn(force.problem, force.fitted, [("creep", "rig")]))
    assert more.parts == (("force_elastic", "rig"), ("creep", "rig"))
    assert set(force.coefficients) < set(more.coefficients)
    for shot, added, left in zip(first.linearised.shots, more.added, more.residual, strict=True):
        assert np.allclose(shot.residual, added + left)
