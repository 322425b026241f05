"""Model and discrepancy at one point: their normal equations, shot by shot.

Coefficients with groups among several shots stand beside the globals; those that every shot has for
itself beside its nuisances, and are eliminated with them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.families import BASELINE, Scale, View, family_columns
from analysis.diagnosis.basis.groupings import groups
from analysis.diagnosis.basis.nonlinearity import RIPPLE, SLEW
from analysis.diagnosis.linearised import PARTS
from analysis.fit.blocks import prior_rows, whitened_squares
from analysis.fit.problem import JointProblem

Array = NDArray[np.float64]
Places = NDArray[np.intp]
Part = tuple[str, str]

STEERED = (RIPPLE, SLEW)
"""Families of the rig that follow the signal so closely that a step of the model asks them."""
STEER_STEP = 1e-4
"""Of the largest signal, to see how they follow."""
OWN_WIDTH = 3.0
"""How large a coefficient of a single shot may be thought of."""


@dataclass(frozen=True)
class Form:
    """What a discrepancy consists of, for all shots of a campaign.

    Attributes
    ----------
    parts : tuple of tuple
        (family, scope); the scope ``shot`` gives every shot its own numbers.
    scale : Scale
        The columns' sizes, kept while the discrepancy is learned.
    places : list
        For each shot and shared part: (first coefficient of a group, weight) each.
    sizes : list of int
        Columns of each shared part.
    shared, own : int
        Coefficients in all, and of each shot.
    labels, own_labels : list of str
        Of the shared coefficients, and of those of each shot.
    """

    parts: tuple[Part, ...]
    scale: Scale
    places: list[list[list[tuple[int, float]]]]
    sizes: list[int]
    shared: int
    own: int
    labels: list[str]
    own_labels: list[str]


@dataclass(frozen=True)
class Point:
    """Where a search is.

    Attributes
    ----------
    theta : ndarray, shape (g,)
        Globals.
    nuisances : ndarray, shape (shots, p)
        Of the base model.
    shared : ndarray, shape (w,)
        Coefficients of the discrepancy.
    own : ndarray, shape (shots, o)
        Coefficients of each shot.
    """

    theta: Array
    nuisances: Array
    shared: Array
    own: Array


@dataclass(frozen=True)
class Block:
    """One shot at a point: shared parameters and columns first, what is its own last.

    Attributes
    ----------
    matrix, vector : ndarray
        Whitened normal equations.
    chain : ndarray, shape (s, g)
        Shared parameters by the globals.
    keep : int
        How many come before what is the shot's own.
    chi2, cost : float
        Whitened squares; the same with what is known of the shot's own numbers.
    residual, added : ndarray, shape (n,)
        What is left, and what the discrepancy adds. [unit of the signal]
    """

    matrix: Array
    vector: Array
    chain: Array
    keep: int
    chi2: float
    cost: float
    residual: Array
    added: Array


def whole_families(parts: Sequence[Part]) -> list[str]:
    """Return the families that hold the columns of some parts."""
    return list(dict.fromkeys(PARTS[f][0] if f in PARTS else f for f, _ in parts))


def _columns(view: View, parts: Sequence[Part]) -> list[tuple[list[str], Array]]:
    """Return labels and columns of each part."""
    whole = {f: family_columns(view, f)[:2] for f in whole_families(parts)}
    chosen = []
    for family, _ in parts:
        if family not in PARTS:
            chosen.append(whole[family])
            continue
        name, first_words = PARTS[family]
        labels, columns = whole[name]
        at = [j for j, label in enumerate(labels) if label.startswith(first_words)]
        chosen.append(([labels[j] for j in at], columns[:, at]))
    return chosen


def form_of(
    problem: JointProblem, theta: Array, nuisances: Array, parts: tuple[Part, ...], scale: Scale
) -> Form:
    """Return the form of a discrepancy for a campaign.

    Parameters
    ----------
    problem : JointProblem
        All shots.
    theta, nuisances : ndarray
        The present model.
    parts : tuple of tuple
        (family, scope).
    scale : Scale
        Sizes, frequencies of the tuned families included.

    Returns
    -------
    Form
        Ready for `block`.
    """
    item = problem.shots[0]
    shared, _ = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisances[0]])
    found, jacobian, _ = problem.model.linearise(local, item.frame)
    clean = found.signal - local[len(problem.model.shared) + 3]
    view = View(problem.model, item, local, clean, jacobian, scale)
    labels_of = [labels for labels, _ in _columns(view, parts)]
    places: list[list[list[tuple[int, float]]]] = [[] for _ in problem.shots]
    labels: list[str] = []
    sizes: list[int] = []
    own: list[str] = []
    for (_, scope), names in zip(parts, labels_of, strict=True):
        if scope == "shot":
            own += names
            continue
        by_shot = groups(problem, scope)
        sizes.append(len(names))
        distinct = sorted({group for shot in by_shot for group, _ in shot})
        first = len(labels)
        for row, shot in enumerate(by_shot):
            places[row].append(
                [(first + distinct.index(group) * len(names), weight) for group, weight in shot]
            )
        labels += [f"{n}{f' [{group}]' if group else ''}" for group in distinct for n in names]
    return Form(parts, scale, places, sizes, len(labels), len(own), labels, own)


def block(problem: JointProblem, form: Form, point: Point, row: int, place: int) -> Block | None:
    """Return one shot's normal equations.

    Parameters
    ----------
    problem : JointProblem
        Some of the shots.
    form : Form
        Of all shots.
    point : Point
        Of these shots.
    row, place : int
        Of the shot, among these and among all.

    Returns
    -------
    Block or None
        None where there is no trace.
    """
    problem.checkpoint()
    model, item = problem.model, problem.shots[row]
    values, chain = problem.shared_local(item, point.theta)
    local = np.concatenate([values, point.nuisances[row]])
    if not np.all(np.isfinite(local)):
        return None
    found, jacobian, gradient = model.linearise(local, item.frame)
    if not np.all(np.isfinite(jacobian)):
        return None
    s = values.size
    clean = found.signal - local[s + 3]
    view = View(model, item, local, clean, jacobian, form.scale)
    parts = _columns(view, form.parts)
    common = [c for (_, sc), (_, c) in zip(form.parts, parts, strict=True) if sc != "shot"]
    single = [c for (_, sc), (_, c) in zip(form.parts, parts, strict=True) if sc == "shot"]
    nothing = np.zeros((clean.size, 0))
    shared_columns = np.column_stack([nothing, *common])
    own_columns = np.column_stack([nothing, *single])
    sizes = of_one_shot(form, place, point.shared)
    added = shared_columns @ sizes
    added += own_columns @ point.own[row]
    jacobian = jacobian + _steered(view, form, common, sizes)
    residual = item.window.signal - found.signal - added
    design = np.column_stack([jacobian[:, :s], shared_columns, own_columns, jacobian[:, s:]])
    squares = whitened_squares(item, residual, design)
    if squares is None:
        return None
    matrix, vector, chi2 = squares
    a, o = shared_columns.shape[1], own_columns.shape[1]
    extra, rows = prior_rows(model, item, local, found.rebound_ratio, gradient)
    at = [*range(s), *range(s + a + o, matrix.shape[0])]
    for value, slope_of in zip(extra, rows, strict=True):
        matrix[np.ix_(at, at)] += np.outer(slope_of, slope_of)
        vector[at] -= value * slope_of
    mine, own = np.arange(s + a, s + a + o), point.own[row]
    matrix[mine, mine] += OWN_WIDTH**-2
    vector[mine] -= own * OWN_WIDTH**-2
    cost = chi2 + float(np.sum(np.square(extra))) + float(own @ own) * OWN_WIDTH**-2
    return Block(matrix, vector, chain, s + a, chi2, cost, residual, added)


def _steered(view: View, form: Form, columns: Sequence[Array], sizes: Array) -> Array:
    """Return how shared columns, so large, change with the model's parameters. Shape (n, p)."""
    found = np.zeros_like(view.jacobian)
    shared = [part for part in form.parts if part[1] != "shot"]
    each = np.split(sizes, np.cumsum(form.sizes, dtype=int))[:-1]
    for part, here, size in zip(shared, columns, each, strict=True):
        if part[0] not in STEERED or not np.any(size):
            continue
        for at, slope in enumerate(view.jacobian.T):
            most = float(np.max(np.abs(slope)))
            if most == 0.0 or at == len(view.model.shared) + BASELINE:
                continue  # a family of the signal does not see the baseline
            step = STEER_STEP * view.scale.top / most
            moved = dataclasses.replace(view, clean=view.clean + step * slope)
            found[:, at] += (_columns(moved, [part])[0][1] - here) @ size / step
    return found


def links(form: Form, place: int) -> tuple[Places, Places, Array]:
    """Return which column hangs on which shared coefficient, and how strongly."""
    column: list[int] = []
    coefficient: list[int] = []
    weight: list[float] = []
    begin = 0
    for own, q in zip(form.places[place], form.sizes, strict=True):
        for first, w in own:
            column += range(begin, begin + q)
            coefficient += range(first, first + q)
            weight += [w] * q
        begin += q
    at, of = np.array(column, dtype=np.intp), np.array(coefficient, dtype=np.intp)
    return at, of, np.array(weight, dtype=np.float64)


def of_one_shot(form: Form, place: int, shared: Array) -> Array:
    """Return what the shared coefficients are for one shot. Shape (a,)."""
    column, coefficient, weight = links(form, place)
    sums = np.bincount(column, weight * shared[coefficient], minlength=sum(form.sizes))
    return np.asarray(sums, dtype=np.float64)


def blocks(
    problem: JointProblem, form: Form, point: Point, places: Sequence[int]
) -> list[Block] | None:
    """Return the blocks of some shots, None where one has no trace."""

    found = []
    for row in range(len(problem.shots)):
        one = block(problem, form, point, row, places[row])
        if one is None:
            return None
        found.append(one)
    return found
