"""A learned closure can be looked at."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.discovery.closure_curve import DEPTHS, closure_curves
from analysis.discovery.quality import quality


@pytest.fixture(scope="session")
def first(leaky):
    """The base model's turn and its fit."""
    step = leaky.steps[0]
    return step, quality(step.problem, step.fitted)


def test_a_linear_closure_takes_up_the_residual_of_a_leaky_coupler(first):
    """With the response family and the model's own numbers, the strongest shot is nearly clean."""
    step, result = first
    found = closure_curves(step, result, step.evidence.explain("response", "rig"))
    assert found["force"] is None
    (curve,) = found["shots"]
    before, left = (np.nanstd([v or np.nan for v in curve[key]]) for key in ("residual", "left"))
    assert left < before / 2


def test_each_owner_has_a_curve(first):
    """Owned by the surface, there is one shot for each of the two."""
    step, result = first
    found = closure_curves(step, result, step.evidence.explain("response", "surface"))
    assert sorted(shot["owner"] for shot in found["shots"]) == ["aluminium", "specimen"]


def test_a_contact_closure_has_a_force(first):
    """Loading, at rest and unloading, over indentation."""
    step, result = first
    found = closure_curves(step, result, step.evidence.explain("contact", "rig"))
    (curve,) = found["force"]["curves"]
    assert [len(share) for share in curve["share"]] == [DEPTHS.size] * 3
