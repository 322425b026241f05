"""From a fit that takes stated numbers as exact to one in which they are as uncertain as stated."""

from __future__ import annotations

import dataclasses

import numpy as np

from analysis.fit import joint
from analysis.fit.inputs import stated_numbers
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult, collect, outcome_of


def with_inputs(problem: JointProblem) -> JointProblem:
    """Return a problem with the campaign's uncertain numbers as globals behind its own.

    Parameters
    ----------
    problem : JointProblem
        Prepared by ``analysis.fit.start``.

    Returns
    -------
    JointProblem
        The problem itself where every number is exact.
    """
    inputs, _ = stated_numbers(problem.campaign, problem.shots)
    if not inputs or problem.inputs:
        return problem
    size, more = len(problem.names), len(inputs)
    precision = np.zeros((size + more, size + more))
    precision[:size, :size] = problem.prior_precision
    precision[range(size, size + more), range(size, size + more)] = [i.u**-2 for i in inputs]
    stated = np.array([i.stated for i in inputs])
    return dataclasses.replace(
        problem,
        names=[*problem.names, *(i.name for i in inputs)],
        start=np.concatenate([problem.start, stated]),
        prior_mean=np.concatenate([problem.prior_mean, stated]),
        prior_precision=precision,
        inputs=inputs,
    )


def inputs_freed(result: FitResult) -> FitResult:
    """Return a fit in which masses, radii, heights and the like are as uncertain as stated.

    Parameters
    ----------
    result : FitResult
        A fit that took them as exact: where this one starts, a step or two from its end.

    Returns
    -------
    FitResult
        Itself where no such number has an uncertainty, or the fit has no solution.
    """
    problem = with_inputs(result.problem)
    if problem is result.problem or not result.fitted.blocks:
        return result
    more = problem.start[len(result.problem.names) :]
    theta = np.concatenate([result.fitted.theta, more])
    fitted = joint.fit(problem, result.fitted.nuisances, theta=theta, damping=joint.LEAST_DAMPING)
    if not fitted.blocks:
        return result
    shots = collect(problem, fitted, scale=result.misfit)
    outcome = outcome_of(problem, fitted)
    return dataclasses.replace(result, outcome=outcome, problem=problem, fitted=fitted, shots=shots)
