"""One shot's normal equations: whitened samples, and what is known of its nuisances."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.fit.nuisances import prior_of
from analysis.fit.problem import UNKNOWN_LOG_U, FitShot, JointProblem
from analysis.model.impact_model import ImpactModel, Prediction


@dataclass(frozen=True)
class ShotBlock:
    """The normal equations of one shot at one point, nuisances last."""

    matrix: Array
    """Whitened J^T J, knowledge of the nuisances included. Shape (s + q, s + q)."""
    vector: Array
    """Whitened -J^T r. Shape (s + q,)."""
    chain: Array
    """The shared local parameters by the globals, shape (s, g); further columns are the inputs that
    the shot depends on."""
    chi2: float
    """Whitened squares of the samples alone."""
    cost: float
    """Whitened squares with the nuisances' priors."""
    known: Array
    """The rows of what is known of this shot, which ``matrix`` contains; see `prior_rows`. Shape
    (k, s + q)."""


def _speed_shift_gradient(model: ImpactModel, item: FitShot, local: Array) -> Array:
    """Return minus the derivative of the effects' shift of ln v0; zeros if no effect shifts it."""
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

    Source: free flight. A camera, or a simulation's last sample, sees the sphere when gravity has
    already slowed it; at low drops a few milliseconds are several per cent.
    """
    at_seen, at_speed = model.shared.index("seen_ms"), len(model.shared)
    loss = item.frame.gravity_m_per_s2 * 1e-3 * math.exp(-local[at_speed])
    slope = gradient.copy()
    slope[at_seen] -= loss
    slope[at_speed] += loss * local[at_seen]
    return rebound - loss * float(local[at_seen]), slope


def prior_residuals(model: ImpactModel, item: FitShot, local: Array, rebound: float) -> Array:
    """Return the residuals of what is known of this shot's nuisances, as `prior_rows` has them."""
    found = []
    at_speed = len(model.shared)
    if item.speed_prior is not None:
        shift = model.speed_shift(local, item.frame)
        found.append((local[at_speed] - item.speed_prior.mean - shift) / item.speed_prior.u)
    known = item.shot.restitution
    if known is not None and known.u > 0:
        seen, _ = rebound_as_seen(model, item, local, rebound, np.zeros(local.size))
        found.append((seen - known.value) / known.u)
    else:
        found.append(local[at_speed + 1] / UNKNOWN_LOG_U)
    for j, parameter in model.of_shot:
        known_of_it = prior_of(parameter)
        found.append((local[j] - known_of_it.mean) / known_of_it.u)
    # a free size as wide as the whole pulse only keeps an unused one finite
    found.extend(local[model.first_size :] / item.window.peak)
    return np.array(found)


def prior_rows(
    model: ImpactModel, item: FitShot, local: Array, rebound: float, gradient: Array
) -> tuple[Array, Array]:
    """Return residuals of what is known of this shot's nuisances, and their gradients.

    The k rows are speed, restitution, effects' numbers of this shot and free sizes; the gradients
    have shape (k, p). ``rebound`` is the ratio at lift-off, ``gradient`` its derivative.
    """
    residuals = prior_residuals(model, item, local, rebound)
    rows = np.zeros((residuals.size, local.size))
    at_speed, row = len(model.shared), 0
    if item.speed_prior is not None:
        rows[0] = _speed_shift_gradient(model, item, local)
        rows[0, at_speed] += 1.0
        rows[0] /= item.speed_prior.u
        row = 1
    known = item.shot.restitution
    if known is not None and known.u > 0:
        rows[row] = rebound_as_seen(model, item, local, rebound, gradient)[1] / known.u
    else:
        rows[row, at_speed + 1] = 1 / UNKNOWN_LOG_U
    row += 1
    for at, (j, parameter) in enumerate(model.of_shot, start=row):
        rows[at, j] = 1 / prior_of(parameter).u
    sizes = range(model.first_size, local.size)
    rows[range(row + len(model.of_shot), residuals.size), sizes] = 1 / item.window.peak
    return residuals, rows


def linearise_shot(
    problem: JointProblem, item: FitShot, theta: Array, nuisance: Array, *, own: bool = False
) -> ShotBlock | None:
    """Return one shot's normal equations at globals ``theta`` and the shot's own ``nuisance``.

    None if the contact did not end, or its squares are not finite. With ``own`` they are those of
    the shot's own parameters alone, all shared ones being held.
    """
    problem.checkpoint()
    stated, item = item, problem.item_at(item, theta)
    shared, chain = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisance])
    if not problem.model.is_thinkable(local):  # such a step is refused, not clamped
        return None
    s, p, acting = shared.size, local.size, [] if own else problem.inputs_of(stated)
    rows = np.zeros((1 + p + len(acting), item.frame.samples))
    first = s if own else 0
    found, gradient = problem.model.differentiate(rows[: 1 + p], local, item.frame, first=first)
    if not (math.isfinite(found.rebound_ratio) and np.isfinite(gradient).all()):
        return None
    residuals, known = prior_rows(problem.model, item, local, found.rebound_ratio, gradient)
    if not np.isfinite(residuals).all():  # heights so far off that nothing falls
        return None
    if acting:
        linear, behind = (found, rows[1 : 1 + p].T, gradient), rows[1 + p :]
        slopes = input_slopes(problem, (stated, item), local, linear, residuals, signal=behind)
        if slopes is None:
            return None
        known = np.hstack([known[:, :s], slopes, known[:, s:]])
        chain = np.vstack([chain, np.eye(theta.size)[[j for j, _ in acting]]])
    np.subtract(item.window.signal, found.signal, out=rows[0])
    if own:
        rows, known, chain = np.delete(rows, slice(1, 1 + s), axis=0), known[:, s:], chain[:0]
        s, p = 0, p - s
    products = item.products(rows)
    if not np.isfinite(products).all():  # a step so hopeless that its squares have no number
        return None
    # inputs stand behind what is shared
    order = [*range(1, 1 + s), *range(1 + p, rows.shape[0]), *range(1 + s, 1 + p)]
    matrix = products[np.ix_(order, order)] + known.T @ known
    vector = products[order, 0] - known.T @ residuals
    chi2 = float(products[0, 0])
    return ShotBlock(matrix, vector, chain, chi2, chi2 + float(residuals @ residuals), known)


def input_slopes(
    problem: JointProblem,
    items: tuple[FitShot, FitShot],
    local: Array,
    linear: tuple[Prediction, Array, Array],
    known: Array,
    *,
    signal: Array,
) -> Array | None:
    """Return what a shot's inputs change beyond its local parameters, which are held.

    That is the derivative of the residuals ``known`` of what is known of this shot, shape (k, i);
    None where a neighbour cannot be evaluated. The zeros ``signal``, shape (i, n), are overwritten
    with the derivative of the trace by each input. [unit of the signal per coordinate] ``items``
    are the shot as stated, and as `JointProblem.item_at` has it; ``linear`` is what
    `ImpactModel.linearise` returns.
    """
    stated, item = items
    found, model = linear[0], problem.model
    acting = problem.inputs_of(stated)
    residuals = np.zeros((known.size, len(acting)))
    by_units = model.slopes_by_units(local, item.frame, linear)
    steps = None
    for column, (_, one) in enumerate(acting):
        added = one.signal(stated)
        if added is not None:
            signal[column] = added
            if item.speed_prior is not None:
                residuals[0, column] = -one.faster_by(stated) / item.speed_prior.u
            continue
        moved = one.moved(item, one.step)
        ratio = found.rebound_ratio
        if one.kind in by_units:
            signal[column], slope = by_units[one.kind]
            ratio += slope * one.step
        elif not model.reads_alike(moved.frame, item.frame):
            steps = steps or model.steps(local, item.frame)
            beside = model.predict(local, moved.frame, steps=steps)
            if not math.isfinite(beside.rebound_ratio):
                return None
            np.subtract(beside.signal, found.signal, out=signal[column])
            signal[column] /= one.step
            ratio = beside.rebound_ratio
        elif moved is item:
            continue
        residuals[:, column] = (prior_residuals(model, moved, local, ratio) - known) / one.step
    return residuals


def shot_cost(problem: JointProblem, item: FitShot, theta: Array, nuisance: Array) -> float:
    """Return one shot's whitened squares with its priors.

    Infinite if there is no trace, or if its squares are not finite.
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
    residuals = prior_residuals(problem.model, item, local, found.rebound_ratio)
    squares = float(item.products((found.signal - item.window.signal)[None, :])[0, 0])
    return squares + float(residuals @ residuals) if math.isfinite(squares) else math.inf
