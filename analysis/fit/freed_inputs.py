"""A fit that took stated numbers as exact is repeated with each free within its stated u."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np

from analysis.aliases import Array
from analysis.fit import joint
from analysis.fit.inputs import LAW, Input, stated_numbers
from analysis.fit.priors import sensor_prior, sensor_transform
from analysis.fit.problem import JointProblem
from analysis.fit.result import FitResult, collect, outcome_of
from analysis.model import solver
from analysis.parameters import CELL, GAIN, ParameterName

SETTLING_STEPS = 8
"""Most steps of a fit that frees inputs. From exact ones it took 3 in 8 of 8 campaigns."""
LEAST_SHARE = 1e-12
"""Of the largest variance, below which a covariance has no direction but rounding."""


def with_inputs(problem: JointProblem) -> JointProblem:
    """Return a prepared problem with the campaign's uncertain numbers appended as globals.

    It is the problem itself if every number is exact.
    """
    inputs, _ = stated_numbers(
        problem.campaign, problem.shots, by_ratio=problem.model.coupon_share_at is not None
    )
    if not inputs or any(one.kind != LAW for one in problem.inputs):
        return problem
    return widened_by(problem, *_with_calibration(problem, inputs))


def widened_by(problem: JointProblem, inputs: tuple[Input, ...], own: Array) -> JointProblem:
    """Return a problem with inputs appended as its last globals, starting where they are stated.

    ``own`` is the precision of what is known of the problem's own globals, shape (g, g).
    """
    size, more = len(problem.names), len(inputs)
    precision = np.zeros((size + more, size + more))
    precision[:size, :size] = own
    precision[range(size, size + more), range(size, size + more)] = [i.u**-2 for i in inputs]
    stated = np.array([i.stated for i in inputs])
    return dataclasses.replace(
        problem,
        names=[*problem.names, *(i.name for i in inputs)],
        start=np.concatenate([problem.start, stated]),
        prior_mean=np.concatenate([problem.prior_mean, stated]),
        prior_precision=precision,
        inputs=(*problem.inputs, *inputs),
    )


def numbers_of_shots(problem: JointProblem) -> tuple[Input, ...]:
    """Return the uncertain numbers that tell shots apart: all but the converter's gain.

    That gain is the same for all shots and counts as the cell's.
    """
    by_ratio = problem.model.coupon_share_at is not None
    stated, _ = stated_numbers(problem.campaign, problem.shots, by_ratio=by_ratio)
    return tuple(one for one in stated if one.kind != "converter_gain")


def with_free_inputs(
    problem: JointProblem, fitted: joint.Fitted
) -> tuple[JointProblem, joint.Fitted] | None:
    """Return a fit in which masses, heights and the like are free within what is stated of them.

    Each number is one more global. None if no number has an uncertainty, or if there is no
    solution.
    """
    inputs = numbers_of_shots(problem)
    if not inputs or problem.inputs or fitted.failed:
        return None
    wide = widened_by(problem, inputs, problem.prior_precision)
    more = wide.start[len(problem.names) :]
    freed = joint.fit(
        wide,
        fitted.nuisances,
        theta=np.concatenate([fitted.theta, more]),
        max_iterations=SETTLING_STEPS,
        damping=joint.LEAST_DAMPING,
        tolerance=joint.ROUGH_TOLERANCE,
    )
    return None if freed.failed else (wide, freed)


def lacks_more_than_numbers(problem: JointProblem, cost: float) -> bool:
    """Tell whether a base model is so far from the shots that no stated number brings it near.

    With an effect one may: the ring of a coupon on a soft tape shows its mass so well that an error
    of the stated 1e-3 left ten times the noise's variance.
    """
    return not problem.model.effects and joint.is_hopeless(problem, cost)


def is_far_whatever_is_stated(problem: JointProblem, fitted: joint.Fitted) -> bool:
    """Tell whether a model is hopeless, with masses, heights and the like off as stated as well."""
    if not joint.is_hopeless(problem, fitted.cost):
        return False
    return joint.is_hopeless(problem, cost_with_free_inputs(problem, fitted))


def cost_with_free_inputs(problem: JointProblem, fitted: joint.Fitted) -> float:
    """Return the squares that are left where masses, heights and the like may be off as stated."""
    if lacks_more_than_numbers(problem, fitted.cost):
        return fitted.cost
    free = with_free_inputs(problem, fitted)
    return fitted.cost if free is None else min(free[1].cost, fitted.cost)


def _with_calibration(
    problem: JointProblem, inputs: tuple[Input, ...]
) -> tuple[tuple[Input, ...], Array]:
    """Return inputs with the cell's slopes: what their errors did to the cell's calibration.

    With them the precision of what is known of the problem's own globals, shape (g, g): the cell's
    covariance is the whole one in ``problem``, and here is without what the inputs carry. A
    calibration that follows its inputs by G per standard uncertainty leaves the cell at
    :math:`s = s_0 + G z + e` with z the inputs' errors and e of covariance :math:`C - G G^T`.
    """
    sensor, precision = problem.campaign.sensor, problem.prior_precision
    if problem.model.kind == solver.HSD:
        at, follows = problem.index(GAIN), sensor.hsd_inputs
        shared = [one for one in inputs if one.name in follows]
        if at is None or not shared or sensor.hsd_n_per_v is None:
            return inputs, precision
        left = 1 / float(precision[at, at]) - sum(follows[one.name] ** 2 for one in shared)
        own = precision.copy()
        own[at, at] = 1 / max(left, LEAST_SHARE / float(precision[at, at]))
        known = {one.name: {"ln_S": follows[one.name] / one.u} for one in shared}
        return _with_slopes(inputs, known), own
    places = problem.positions(CELL)
    shared = [one for one in inputs if one.name in sensor.inputs]
    if places is None or sensor.covariance is None or not shared:
        return inputs, precision
    by_u = np.array([sensor.inputs[one.name] for one in shared])
    rest = dataclasses.replace(sensor, covariance=without_inputs(sensor.covariance, by_u))
    own = precision.copy()
    own[np.ix_(places, places)] += sensor_prior(rest)[0] - sensor_prior(sensor)[0]
    slopes = np.linalg.solve(sensor_transform(), by_u.T).T
    numbers = [name.quantity for name in CELL]
    known = {
        one.name: dict(zip(numbers, (row / one.u).tolist(), strict=True))
        for one, row in zip(shared, slopes, strict=True)
    }
    return _with_slopes(inputs, known), own


def _with_slopes(
    inputs: tuple[Input, ...], known: Mapping[ParameterName, Mapping[str, float]]
) -> tuple[Input, ...]:
    return tuple(dataclasses.replace(one, cell=known.get(one.name, {})) for one in inputs)


def without_inputs(covariance: Array, follows: Array) -> Array:
    """Return a cell's covariance of logarithms without the part that inputs carry.

    It is positive definite. ``follows``, shape (k, n), is the change of the logarithms by one u of
    each input.
    """
    values, vectors = np.linalg.eigh(covariance - follows.T @ follows)
    # what rounding takes below zero is a direction that the inputs alone leave open
    floor = LEAST_SHARE * float(values.max())
    return np.asarray((vectors * np.maximum(values, floor)) @ vectors.T)


def inputs_freed(result: FitResult, *, steps: int = joint.MAX_ITERATIONS) -> FitResult:
    """Return a fit in which masses, radii, heights and the like are as uncertain as stated.

    It starts from ``result`` and ends a step or two from there. It is ``result`` itself if no such
    number has an uncertainty, or if the fit has no solution.
    """
    problem = with_inputs(result.problem)
    if problem is result.problem or result.fitted.failed:
        return result
    more = problem.start[len(result.problem.names) :]
    theta = np.concatenate([result.fitted.theta, more])
    fitted = joint.fit(
        problem,
        result.fitted.nuisances,
        theta=theta,
        damping=joint.LEAST_DAMPING,
        tolerance=joint.STEP_TOLERANCE if result.misfit == 1.0 else joint.ROUGH_TOLERANCE,
        max_iterations=steps,
    )
    if fitted.failed:
        return result
    shots = collect(problem, fitted, scale=result.misfit)
    outcome = outcome_of(problem, fitted)
    return dataclasses.replace(result, outcome=outcome, problem=problem, fitted=fitted, shots=shots)
