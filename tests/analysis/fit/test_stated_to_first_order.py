"""Stated numbers to first order: the same minimum as with the numbers themselves free."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.diagnosis.candidate import extended
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.freed_inputs import with_free_inputs
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.fit.stated_to_first_order import as_stated, with_stated_numbers
from analysis.model.impact_model import model_named
from impactd.bench.blind.plan import draw_plan
from impactd.bench.simulated_campaign import simulated_campaign

SQUARES = 0.5
"""Far below what any decision asks of a difference."""


@pytest.fixture(scope="module")
def stated() -> tuple[JointProblem, joint.Fitted]:
    """A clean rig whose labels are off by what is stated of them, taken as exact."""
    plan = draw_plan("clean", 11)
    problem = build(simulated_campaign(plan.settings, plan.campaign_seed), model_named(plan.base))
    problem, nuisances = with_start(problem)
    return problem, joint.fit(problem, nuisances)


def test_the_minimum_is_that_of_free_numbers(stated: tuple[JointProblem, joint.Fitted]) -> None:
    """Every number ends where it does when it is free itself, within a tenth of its u."""
    wide = with_stated_numbers(*stated)
    assert wide is not None
    problem, theta = wide
    found = joint.fit(problem, stated[1].nuisances, theta=theta)
    free = with_free_inputs(*stated)
    assert free is not None
    assert stated[1].cost - free[1].cost > 20 * SQUARES
    assert found.cost == pytest.approx(free[1].cost, abs=SQUARES)
    first = len(stated[0].names)
    u = np.array([one.u for one in problem.inputs])
    begun = np.array([one.stated for one in free[0].inputs])
    apart = (found.theta[first:] - (free[1].theta[first:] - begun)) / u
    assert np.abs(apart).max() < 0.1


def test_an_effect_stands_before_the_numbers(stated: tuple[JointProblem, joint.Fitted]) -> None:
    """Inputs are the last globals, whatever is added; taken off, all is as it was."""
    wide = with_stated_numbers(*stated)
    assert wide is not None
    problem, theta = wide
    fitted = joint.fit(problem, stated[1].nuisances, theta=theta)
    larger, start, nuisances = extended(problem, fitted, effect_named("release_speed_bias"), {})
    count = len(problem.inputs)
    assert larger.names[-count:] == [one.name for one in larger.inputs]
    assert joint.total_cost(larger, start, nuisances) == pytest.approx(fitted.cost)
    exact, begin = as_stated(problem, theta)
    assert exact.names == stated[0].names
    assert joint.total_cost(exact, begin, stated[1].nuisances) == pytest.approx(stated[1].cost)


def test_no_effect_explains_what_a_stated_height_explains(
    stated: tuple[JointProblem, joint.Fitted],
) -> None:
    """A release bias gains where heights are taken as exact, and next to nothing where not."""

    def gain(problem: JointProblem, fitted: joint.Fitted) -> float:
        larger, start, nuisances = extended(problem, fitted, effect_named("release_speed_bias"), {})
        return fitted.cost - joint.fit(larger, nuisances, theta=start).cost

    wide = with_stated_numbers(*stated)
    assert wide is not None
    problem, theta = wide
    free = joint.fit(problem, stated[1].nuisances, theta=theta)
    assert gain(*stated) > 10 * max(gain(problem, free), 1.0)


def test_no_number_is_freed_twice(stated: tuple[JointProblem, joint.Fitted]) -> None:
    """A problem whose numbers are uncertain already is left alone."""
    wide = with_stated_numbers(*stated)
    assert wide is not None
    assert with_stated_numbers(wide[0], stated[1]) is None
