"""One shot's normal equations: whitened samples, and what is known of its nuisances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.fit.nuisances import prior_of
from analysis.fit.problem import UNKNOWN_LOG_U, FitShot, JointProblem
from analysis.model.impact_model import ImpactModel, Prediction

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ShotBlock:
    """The normal equations of one shot at one point, nuisances last.

    Attributes
    ----------
    matrix : ndarray, shape (s + q, s + q)
        Whitened J^T J, knowledge of the nuisances included.
    vector : ndarray, shape (s + q,)
        Whitened -J^T r.
    chain : ndarray, shape (s, g)
        Shared local parameters by the globals; behind them the inputs that the shot depends on.
    chi2 : float
        Whitened squares of the samples alone.
    cost : float
        Whitened squares with the nuisances' priors.
    known : ndarray, shape (k, s + q)
        The rows of what is known of this shot, which ``matrix`` contains; see `prior_rows`.
    """

    matrix: Array
    vector: Array
    chain: Array
    chi2: float
    cost: float
    known: Array


def _speed_shift_gradient(model: ImpactModel, item: FitShot, local: Array) -> Array:
    """Return minus the derivative of the effects' shift of ln v0; zeros without such an effect."""
    row = np.zeros(local.size)
    if not any(e.speed is not None for e in model.effects):
        return row
    step = 1e-5
    for j in (at for e in model.effects if e.speed is not None for at in model.places[e.id]):
        moved = local.copy()
        moved[j] += step
        above = model.speed_shift(moved, item.frame)
        moved[j] -= 2 * step
        row[j] = -(above - model.speed_shift(moved, item.frame)) / (2 * step)
    return row


def rebound_as_seen(
    model: ImpactModel, item: FitShot, local: Array, rebound: float, gradient: Array
) -> tuple[float, Array]:
    r"""Return the rebound ratio that an observer reads, and its gradient.

    .. math:: r_{seen} = r - g\, t_{seen} / v_0

    Parameters
    ----------
    model : ImpactModel
        Says where the parameters are.
    item : FitShot
        The shot.
    local : ndarray, shape (p,)
        Local parameters.
    rebound, gradient : float, ndarray of shape (p,)
        Ratio at lift-off, and its derivative.

    Returns
    -------
    tuple
        Ratio and gradient, both as seen.

    Notes
    -----
    Source: free flight. A camera, or a simulation's last sample, sees the sphere when gravity has
    already slowed it; at low drops a few milliseconds are several per cent.
    """
    at_seen, at_speed = model.shared.index("seen_ms"), len(model.shared)
    loss = item.frame.gravity_m_per_s2 * 1e-3 * math.exp(-local[at_speed])
    slope = gradient.copy()
    slope[at_seen] -= loss
    slope[at_speed] += loss * local[at_seen]
    return rebound - loss * float(local[at_seen]), slope


def prior_rows(
    model: ImpactModel, item: FitShot, local: Array, rebound: float, gradient: Array
) -> tuple[list[float], list[Array]]:
    """Return residuals and gradients of what is known of this shot's nuisances."""
    residuals, rows = [], []
    at_speed, at_e = len(model.shared), len(model.shared) + 1
    if item.speed_prior is not None:
        row = _speed_shift_gradient(model, item, local)
        shift = model.speed_shift(local, item.frame)
        row[at_speed] += 1.0
        u = item.speed_prior.u
        residuals.append((local[at_speed] - item.speed_prior.mean - shift) / u)
        rows.append(row / u)
    known = item.shot.restitution
    if known is not None and known.u > 0:
        seen, slope = rebound_as_seen(model, item, local, rebound, gradient)
        residuals.append((seen - known.value) / known.u)
        rows.append(slope / known.u)
    else:
        row = np.zeros(local.size)
        row[at_e] = 1 / UNKNOWN_LOG_U
        residuals.append(local[at_e] / UNKNOWN_LOG_U)
        rows.append(row)
    for j, parameter in model.of_shot:
        known_of_it = prior_of(parameter)
        row = np.zeros(local.size)
        row[j] = 1 / known_of_it.u
        residuals.append((local[j] - known_of_it.mean) / known_of_it.u)
        rows.append(row)
    for j in range(model.first_size, local.size):
        # a free size as wide as the whole pulse only keeps an unused one finite
        row = np.zeros(local.size)
        row[j] = 1 / item.window.peak
        residuals.append(local[j] / item.window.peak)
        rows.append(row)
    return residuals, rows


def linearise_shot(
    problem: JointProblem, item: FitShot, theta: Array, nuisance: Array
) -> ShotBlock | None:
    """Return one shot's normal equations, None where the model cannot be evaluated.

    Parameters
    ----------
    problem : JointProblem
        Model and mapping.
    item : FitShot
        The shot.
    theta : ndarray, shape (g,)
        Globals.
    nuisance : ndarray, shape (q,)
        The shot's own, in the order of ``model.nuisances``.

    Returns
    -------
    ShotBlock or None
        None when the contact did not end, or its squares have no number.
    """
    problem.checkpoint()
    stated, item = item, problem.item_at(item, theta)
    shared, chain = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisance])
    if not problem.model.is_thinkable(local):  # such a step is refused, not clamped
        return None
    found, jacobian, gradient = linear = problem.model.linearise(local, item.frame)
    if not (math.isfinite(found.rebound_ratio) and np.isfinite(gradient).all()):
        return None
    if not np.isfinite(jacobian[-1]).all():
        return None
    extra, rows = prior_rows(problem.model, item, local, found.rebound_ratio, gradient)
    acting = problem.inputs_of(stated)
    if acting:
        slopes = input_slopes(problem, (stated, item), local, linear, extra)
        if slopes is None:
            return None
        s = shared.size
        jacobian = np.hstack([jacobian[:, :s], slopes[0], jacobian[:, s:]])
        rows = [
            np.concatenate([row[:s], own, row[s:]])
            for row, own in zip(rows, slopes[1], strict=True)
        ]
        chain = np.vstack([chain, np.eye(theta.size)[[j for j, _ in acting]]])
    squares = whitened_squares(item, item.window.signal - found.signal, jacobian)
    if squares is None:
        return None
    matrix, vector, chi2 = squares
    for residual, row in zip(extra, rows, strict=True):
        matrix += np.outer(row, row)
        vector -= residual * row
    cost = chi2 + sum(x * x for x in extra)
    return ShotBlock(matrix, vector, chain, chi2, cost, np.array(rows))


def input_slopes(
    problem: JointProblem,
    items: tuple[FitShot, FitShot],
    local: Array,
    linear: tuple[Prediction, Array, Array],
    known: list[float],
) -> tuple[Array, Array] | None:
    """Return what a shot's inputs change beyond its local parameters, which are held.

    Parameters
    ----------
    problem : JointProblem
        With inputs.
    items : tuple of FitShot
        The shot as stated, and as `JointProblem.item_at` has it.
    local : ndarray, shape (p,)
        Local parameters.
    linear : tuple
        The trace and its derivatives, as `ImpactModel.linearise` returns them.
    known : list of float
        Residuals of what is known of this shot, k of them.

    Returns
    -------
    signal : ndarray, shape (n, i)
        Derivative of the trace by each input. [unit of the signal per coordinate]
    residuals : ndarray, shape (k, i)
        Derivative of the residuals. None where a neighbour cannot be evaluated.
    """
    stated, item = items
    found = linear[0]
    acting = problem.inputs_of(stated)
    signal, residuals = (
        np.zeros((found.signal.size, len(acting))),
        np.zeros((len(known), len(acting))),
    )
    steps = problem.model.steps(local, item.frame)
    by_units = problem.model.slopes_by_units(local, item.frame, linear)
    for column, (_, one) in enumerate(acting):
        moved = one.moved(item, one.step)
        ratio = found.rebound_ratio
        added = one.signal(stated)
        if added is not None:
            signal[:, column] = added
        elif one.kind in by_units:
            signal[:, column], slope = by_units[one.kind]
            ratio += slope * one.step
        elif not problem.model.reads_alike(moved.frame, item.frame):
            beside = problem.model.predict(local, moved.frame, steps=steps)
            if not math.isfinite(beside.rebound_ratio):
                return None
            signal[:, column] = (beside.signal - found.signal) / one.step
            ratio = beside.rebound_ratio
        ahead, _ = prior_rows(problem.model, moved, local, ratio, np.zeros(local.size))
        residuals[:, column] = (np.array(ahead) - known) / one.step
    return signal, residuals


def whitened_squares(
    item: FitShot, residual: Array, slopes: Array
) -> tuple[Array, Array, float] | None:
    """Return one shot's normal equations in units of its noise, without priors.

    Parameters
    ----------
    item : FitShot
        The shot.
    residual : ndarray, shape (n,)
        Record less model. [unit of the signal]
    slopes : ndarray, shape (n, p)
        The model's derivatives.

    Returns
    -------
    matrix, vector : ndarray, shape (p, p), (p,)
        Of the step that makes the squares least.
    chi2 : float
        The squares. All None for a step so hopeless that they have no number.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        columns = np.empty((slopes.shape[1] + 1, residual.size))  # one transform for all is quicker
        columns[:-1], columns[-1] = slopes.T, residual
        whole = item.whiten(columns.T)
        slope, white = whole[:, :-1], whole[:, -1]
        matrix, vector = slope.T @ slope, slope.T @ white
        chi2 = float(white @ white)
    if math.isfinite(chi2) and np.isfinite(matrix).all() and np.isfinite(vector).all():
        return matrix, vector, chi2
    return None


def shot_cost(problem: JointProblem, item: FitShot, theta: Array, nuisance: Array) -> float:
    """Return one shot's whitened squares with its priors; infinite where there is no trace.

    So they are for a step so hopeless that its squares have no number.
    """
    problem.checkpoint()
    item = problem.item_at(item, theta)
    shared, _ = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisance])
    if not problem.model.is_thinkable(local):  # such a step is refused, not clamped
        return math.inf
    found = problem.model.predict(local, item.frame)
    if not math.isfinite(found.rebound_ratio):
        return math.inf
    extra, _ = prior_rows(problem.model, item, local, found.rebound_ratio, np.zeros(local.size))
    with np.errstate(over="ignore", invalid="ignore"):
        r = item.whiten(found.signal - item.window.signal)
        squares = float(r @ r)
    return squares + sum(x * x for x in extra) if math.isfinite(squares) else math.inf
