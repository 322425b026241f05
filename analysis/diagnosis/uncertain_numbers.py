"""A search in which masses, heights and the like may be off by what is stated of them.

What such errors explain is no structure, and no effect is taken to explain it. They are further
globals with their stated uncertainty, to first order, from the base model to the last comparison. A
document then states every model with the numbers as stated, as `impactd fit` does.
"""

from __future__ import annotations

import dataclasses

from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.progress import unwatched
from analysis.diagnosis.selection import Selection, Step
from analysis.fit import joint
from analysis.fit.freed_inputs import SETTLING_STEPS
from analysis.fit.problem import JointProblem
from analysis.fit.stated_to_first_order import as_stated, fitted_with_stated_numbers


def with_uncertain_numbers(selection: Selection) -> Selection:
    """Return a selection whose last model leaves stated numbers free within their uncertainty.

    Itself where all of them are exact, or the model is far from the shots: what an error of a
    number would change is then asked at a place where nothing is right.
    """
    last = selection.last
    samples = sum(shot.item.expected_squares for shot in last.residual.shots)
    if last.residual.chi2 > CRITERIA.far_squares_per_sample * samples:
        return selection
    # to its end, whatever the time: it is part of the base fit
    free = fitted_with_stated_numbers(unwatched(last.problem), last.fitted)
    if free is None:
        return selection
    watched = dataclasses.replace(free[0], checkpoint=last.problem.checkpoint)
    return Selection([*selection.steps[:-1], Step(watched, free[1])], selection.chosen)


def with_numbers_as_stated(found: Selection, start: Selection) -> Selection:
    """Return what was found from a start, each model fitted with the numbers as stated.

    Whether a residual is noise, and what each effect explains, stays as the search has it.
    """
    at, last = len(start.steps) - 1, start.last
    base = found.steps[at]
    if base.problem.inputs:
        base = dataclasses.replace(
            base, problem=last.problem, fitted=last.fitted, tested=base.test()
        )
        if base.structured:
            base.tested = last.test()
    steps = [*found.steps[:at], base, *map(_exact_step, found.steps[at + 1 :])]
    chosen = [
        dataclasses.replace(taken, problem=step.problem, fitted=step.fitted)
        for taken, step in zip(found.chosen, steps[1:], strict=True)
    ]
    return Selection(steps, chosen)


def _exact_step(step: Step) -> Step:
    problem, fitted = _exact(step.problem, step.fitted)
    return dataclasses.replace(step, problem=problem, fitted=fitted, tested=step.test())


def exact_refit(found: Refit) -> Refit:
    """Return a refit with the numbers as stated; its gain stays as the search has it."""
    problem, fitted = _exact(found.problem, found.fitted)
    return dataclasses.replace(found, problem=problem, fitted=fitted)


def _exact(problem: JointProblem, fitted: joint.Fitted) -> tuple[JointProblem, joint.Fitted]:
    if fitted.failed:
        return problem, fitted
    if problem.inputs:
        exact, theta = as_stated(problem, fitted.theta)
    else:
        exact, theta = problem, fitted.theta
    # a document fits it once more, to its end
    found = joint.fit(
        unwatched(exact),
        fitted.nuisances,
        theta=theta,
        damping=joint.LEAST_DAMPING,
        max_iterations=SETTLING_STEPS,
    )
    exact = dataclasses.replace(exact, checkpoint=problem.checkpoint)
    return exact, found
