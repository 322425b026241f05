"""What a joint fit says in logarithms: single parameters, the cell, a pair's reduced modulus."""

from __future__ import annotations

import math

import numpy as np

from analysis.aliases import Array
from analysis.fit.joint import Fitted
from analysis.fit.problem import (
    SENSOR_FIELDS,
    SENSOR_OFFSET,
    FitShot,
    JointProblem,
    sensor_transform,
)
from analysis.model import solver
from analysis.parameters import CELL

HSD_FIELDS = ("hsd_n_per_v",)


def log_of(problem: JointProblem, fitted: Fitted, name: str) -> tuple[float, float]:
    """Return a global's logarithm (or an effect's coordinate) and its standard uncertainty."""
    gradient = problem.gradient_of(name)
    u = math.sqrt(float(gradient @ fitted.covariance @ gradient))
    return problem.value_of(name, fitted.theta), u


def sensor_logs(problem: JointProblem, fitted: Fitted) -> tuple[Array, Array] | None:
    """Return ln(M, k, mu, c) and covariance, None unless all four are parameters."""
    at = problem.positions(CELL)
    if at is None:
        return None
    transform = sensor_transform()
    values = np.array([problem.value_of(name, fitted.theta) for name in CELL])
    rows = transform @ np.array([problem.gradient_of(name) for name in CELL])
    return transform @ values + SENSOR_OFFSET, rows @ fitted.covariance @ rows.T


def covariance_of_numbers(problem: JointProblem, fitted: Fitted) -> Array:
    """Return the covariance of what the globals' names stand for, see `gradient_of` of the problem.

    Shape (g, g), in the order of ``problem.names``.
    """
    rows = np.array([problem.gradient_of(name) for name in problem.names])
    return np.asarray(rows @ fitted.covariance @ rows.T)


def pair_modulus(
    problem: JointProblem, fitted: Fitted, item: FitShot
) -> tuple[float, float, Array] | None:
    """Return ln E*, its standard uncertainty and its gradient by the globals.

    None in reduced units, where a stiffness is no modulus.
    """
    if item.radius_m is None:
        return None
    at = problem.item_at(item, fitted.theta)
    assert at.radius_m is not None
    values, chain = problem.shared_local(at, fitted.theta)
    log = float(values[0]) - math.log(4 / 3 * math.sqrt(at.radius_m))
    gradient = chain[0]
    for j, one in problem.inputs_of(item):
        if one.kind == "radius":
            gradient[j] -= 0.5
    return log, math.sqrt(float(gradient @ fitted.covariance @ gradient)), gradient


def calibration_part(problem: JointProblem, fitted: Fitted, item: FitShot) -> tuple[float, Array]:
    r"""Return the part of u(ln E*) that comes from the cell's stated values.

    Returns
    -------
    u : float
        Standard uncertainty, common to all fits that take the cell from one calibration, without
        what the inputs of the calibration carry. [1]
    sensitivity : ndarray, shape (4,) or (1,)
        d ln E* / d ln(M, k, mu, c) for KV, d ln E* / d ln S for HSD: how E* follows when the
        stated values are wrong. Zeros where the cell is no complete parameter.

    Notes
    -----
    With precision P of the priors and covariance :math:`\Sigma` of the fit, an error d of the
    prior means moves the fit by :math:`\Sigma P d`; the rest of :math:`\Sigma` is this
    recording's own noise and independent from shot to shot.
    """
    found = pair_modulus(problem, fitted, item)
    at = [j for j, n in enumerate(problem.names) if n.kind == "sensor"]
    size = 1 if problem.model.kind == solver.HSD else len(SENSOR_FIELDS)
    if found is None or not at:
        return 0.0, np.zeros(size)
    follows = found[2] @ fitted.covariance[:, at]
    precision = problem.prior_precision[np.ix_(at, at)]
    sensitivity = np.zeros(size)
    if len(at) == size:
        sensitivity = follows @ precision
        if size > 1:
            sensitivity = sensitivity @ np.linalg.inv(sensor_transform())
    return math.sqrt(max(float(follows @ precision @ follows), 0.0)), sensitivity


def through_calibration(problem: JointProblem, fitted: Fitted, item: FitShot) -> dict[str, float]:
    """Return by input how ln E* follows it through the cell's calibration alone.

    Per unit of the input's coordinate: a part of what `input_parts` returns.
    """
    found = pair_modulus(problem, fitted, item)
    at = [j for j, n in enumerate(problem.names) if n.kind == "sensor"]
    if found is None:
        return {}
    precision = problem.prior_precision[np.ix_(at, at)]
    follows = found[2] @ fitted.covariance[:, at] @ precision
    known = [problem.names[j].quantity for j in at]
    return {
        one.name: float(sum(f * one.cell.get(q, 0.0) for f, q in zip(follows, known, strict=True)))
        for one in problem.inputs
    }


def input_parts(
    problem: JointProblem, fitted: Fitted, rows: Array
) -> dict[str, tuple[Array, float]]:
    r"""Return how directions in the globals follow the stated masses, radii and the like.

    ``rows`` has shape (k, g). By input: the change of each row per unit of the stated coordinate,
    shape (k,), and the standard uncertainty of that coordinate. As in `calibration_part`, an error
    d of a stated value moves the fit by :math:`\Sigma P d`.
    """
    found: dict[str, tuple[Array, float]] = {}
    first = len(problem.names) - len(problem.inputs)
    for j, one in enumerate(problem.inputs, start=first):
        found[one.name] = (rows @ fitted.covariance[:, j] / one.u**2, one.u)
    return found
