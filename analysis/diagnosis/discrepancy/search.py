"""The search for a discrepancy: model and coefficients move together until they agree."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.discrepancy.normal_equations import Block, Form, Point, blocks, links
from analysis.fit import steps
from analysis.fit.problem import JointProblem

Array = NDArray[np.float64]

# Levenberg and Marquardt's, of the diagonal; the least no longer shortens a step
FIRST_DAMPING, LEAST_DAMPING = 1e-4, 1e-9
SHRINKS = 4
"""Steps that may fail one after the other."""
AGREED = 3e-4
"""Relative fall of the cost at which a search ends."""
SETTLE_STEPS = 4
"""Of the shots' own numbers, the shared ones held. Chosen by trial."""


@dataclass(frozen=True)
class TrainingShots:
    """Shots that a discrepancy is learned on.

    Attributes
    ----------
    problem : JointProblem
        Some of the shots.
    form : Form
        Of all shots.
    places : list of int
        Where these are among all.
    width : float
        How large a shared coefficient is thought of.
    """

    problem: JointProblem
    form: Form
    places: list[int]
    width: float

    def part(self, rows: Sequence[int]) -> TrainingShots:
        """Return the same of some of the shots."""
        problem = dataclasses.replace(self.problem, shots=[self.problem.shots[i] for i in rows])
        return dataclasses.replace(self, problem=problem, places=[self.places[i] for i in rows])


@dataclass(frozen=True)
class Reached:
    """A point with its blocks and its cost."""

    point: Point
    blocks: list[Block]
    cost: float


@dataclass(frozen=True)
class _Reduced:
    """One shot with all its own numbers eliminated, and how they follow."""

    matrix: Array
    vector: Array
    back: Array
    own: Array


def reach(training: TrainingShots, point: Point) -> Reached | None:
    """Return a point with its cost, None where there is no trace."""
    found = blocks(training.problem, training.form, point, training.places)
    if found is None:
        return None
    away = point.theta - training.problem.prior_mean
    cost = sum(b.cost for b in found) + float(away @ training.problem.prior_precision @ away)
    return Reached(point, found, cost + float(point.shared @ point.shared) * training.width**-2)


def _reduced(one: Block, damping: float) -> _Reduced:
    k = one.keep
    inner = one.matrix[k:, k:].copy()
    inner[np.diag_indices_from(inner)] *= 1.0 + damping
    cross = one.matrix[:k, k:]
    right = np.column_stack([cross.T, one.vector[k:]])
    solved = np.asarray(np.linalg.solve(inner, right), dtype=np.float64)
    back, own = solved[:, :-1], solved[:, -1]
    return _Reduced(one.matrix[:k, :k] - cross @ back, one.vector[:k] - cross @ own, back, own)


def _spread(training: TrainingShots, row: int, one: Block) -> tuple[NDArray[np.intp], Array]:
    """Return where a shot's parameters and columns are among globals and coefficients: a map."""
    s, g = one.chain.shape
    column, coefficient, weight = links(training.form, training.places[row])
    at = np.unique(coefficient)
    wide = np.zeros((one.keep, g + at.size))
    wide[:s, :g] = one.chain
    wide[s + column, g + np.searchsorted(at, coefficient)] = weight
    return np.concatenate([np.arange(g), g + at]), wide


def _normal(
    training: TrainingShots, found: Reached, parts: Sequence[_Reduced], rows: Sequence[int]
) -> tuple[Array, Array]:
    """Return the normal equations of globals and coefficients over some shots, without priors."""
    size = found.point.theta.size + training.form.shared
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    for row in rows:
        at, wide = _spread(training, row, found.blocks[row])
        matrix[np.ix_(at, at)] += wide.T @ parts[row].matrix @ wide
        vector[at] += wide.T @ parts[row].vector
    return matrix, vector


def _with_priors(
    training: TrainingShots, point: Point, matrix: Array, vector: Array, width: float
) -> tuple[Array, Array]:
    g = point.theta.size
    matrix, vector = matrix.copy(), vector.copy()
    matrix[:g, :g] += training.problem.prior_precision
    vector[:g] -= training.problem.prior_precision @ (point.theta - training.problem.prior_mean)
    at = np.arange(g, matrix.shape[0])
    matrix[at, at] += width**-2
    vector[g:] -= point.shared * width**-2
    return matrix, vector


def best_width(
    training: TrainingShots, found: Reached, folds: Sequence[Sequence[int]], widths: Sequence[float]
) -> tuple[float, float]:
    """Return the size of coefficients that holds best on other shots, and the fall it brings.

    Parameters
    ----------
    training : TrainingShots
        All shots.
    found : Reached
        The present model, no discrepancy yet.
    folds : sequence of sequence of int
        Shots to hold out together.
    widths : sequence of float
        To choose from.

    Returns
    -------
    width, gain : float
        The gain is that of the whitened squares of held-out shots, to first order.
    """
    parts = [_reduced(b, 0.0) for b in found.blocks]
    pieces = [_normal(training, found, parts, fold) for fold in folds]
    whole = sum((m for m, _ in pieces), start=np.zeros(()))
    load = sum((v for _, v in pieces), start=np.zeros(()))
    gains = dict.fromkeys(widths, 0.0)
    g = found.point.theta.size
    for inside, own in pieces:
        rest, pull = whole - inside, load - own
        least, force = _with_priors(training, found.point, rest, pull, 1.0)
        base = np.linalg.solve(least[:g, :g], force[:g])
        without = float(2 * base @ own[:g] - base @ inside[:g, :g] @ base)
        for width in widths:
            x = np.linalg.solve(*_with_priors(training, found.point, rest, pull, width))
            gains[width] += float(2 * x @ own - x @ inside @ x) - without
    best = max(gains, key=lambda w: gains[w])
    return best, gains[best]


def descend(training: TrainingShots, here: Reached, rounds: int) -> Reached:
    """Return where model and discrepancy agree, after at most so many rounds.

    Parameters
    ----------
    training : TrainingShots
        The shots to learn from.
    here : Reached
        Where to begin.
    rounds : int
        Steps, those that failed included.

    Returns
    -------
    Reached
        Never worse than the beginning.
    """
    damping, failed = FIRST_DAMPING, 0
    g = here.point.theta.size
    for _ in range(rounds):
        parts = [_reduced(b, damping) for b in here.blocks]
        rows = range(len(here.blocks))
        matrix, vector = _with_priors(
            training, here.point, *_normal(training, here, parts, rows), training.width
        )
        matrix[np.diag_indices(g)] *= 1.0 + damping
        step = np.asarray(np.linalg.solve(matrix, vector), dtype=np.float64)
        ahead = reach(training, _moved(training, here, parts, step))
        if ahead is None or not ahead.cost < here.cost:
            failed += 1
            damping = max(100.0 * damping, 1e-3)
            if failed >= SHRINKS:
                break
            continue
        small = here.cost - ahead.cost < AGREED * here.cost
        here, failed, damping = ahead, 0, max(damping / 10, LEAST_DAMPING)
        if small:
            break
    return here


def _moved(training: TrainingShots, here: Reached, parts: Sequence[_Reduced], step: Array) -> Point:
    """Return the point after a step of globals and coefficients, each shot's own following."""
    point = here.point
    g, o = point.theta.size, point.own.shape[1]
    nuisances, own = point.nuisances.copy(), point.own.copy()
    for row, part in enumerate(parts):
        at, wide = _spread(training, row, here.blocks[row])
        mine = part.own - part.back @ (wide @ step[at])
        own[row] += mine[:o]
        nuisances[row] += mine[o:]
    theta = steps.along(training.problem, point.theta, step[:g])
    return Point(theta, nuisances, point.shared + step[g:], own)


def settled(training: TrainingShots, point: Point) -> Reached | None:
    """Return each shot's own numbers at their best, everything shared kept.

    Parameters
    ----------
    training : TrainingShots
        The shots.
    point : Point
        Where to begin.

    Returns
    -------
    Reached or None
        None where there is no trace.
    """
    here = reach(training, point)
    if here is None:
        return None
    damping = np.full(len(here.blocks), FIRST_DAMPING)
    o = point.own.shape[1]
    for _ in range(SETTLE_STEPS):
        steps = [_reduced(b, float(d)).own for b, d in zip(here.blocks, damping, strict=True)]
        mine = np.array(steps)
        there = Point(point.theta, here.point.nuisances + mine[:, o:], point.shared,
                      here.point.own + mine[:, :o])  # fmt: skip
        ahead = reach(training, there)
        if ahead is None:
            damping *= 100.0
            continue
        better = [new.cost < old.cost for new, old in zip(ahead.blocks, here.blocks, strict=True)]
        fall = here.cost - ahead.cost
        here = _chosen(training, here, ahead, better)
        damping = np.where(better, np.maximum(damping / 10, LEAST_DAMPING), damping * 100.0)
        if all(better) and fall < AGREED * here.cost:
            break
    return here


def _chosen(training: TrainingShots, old: Reached, new: Reached, better: Sequence[bool]) -> Reached:
    """Return each shot where it fares better."""
    del training
    which = np.array(better)[:, None]
    point = dataclasses.replace(
        old.point,
        nuisances=np.where(which, new.point.nuisances, old.point.nuisances),
        own=np.where(which, new.point.own, old.point.own),
    )
    found = [n if b else o for n, o, b in zip(new.blocks, old.blocks, better, strict=True)]
    change = sum(b.cost for b in found) - sum(b.cost for b in old.blocks)
    return Reached(point, found, old.cost + change)
