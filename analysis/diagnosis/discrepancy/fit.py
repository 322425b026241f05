"""Discrepancies fitted together with the model and tested on held-out shots.

The linearisation is first order around one fit. Here the fit moves: columns and model are fitted to
each other until they agree, as one would a named effect, and the error on held-out shots is
that of the repaired prediction. Numbers that every shot has for itself are fitted to a held-out
shot as its speed and its touch-down are: they stand beside its nuisances and are eliminated with
them, while coefficients with groups among several shots stand beside the globals.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from analysis.aliases import Array
from analysis.diagnosis.basis.families import BASELINE, Scale, View, family_columns, scale_of, tuned
from analysis.diagnosis.basis.groupings import groups
from analysis.diagnosis.basis.nonlinearity import RIPPLE, SLEW
from analysis.diagnosis.candidate import extended
from analysis.diagnosis.held_out import heldout_or_none
from analysis.diagnosis.linearised import Linearised
from analysis.effects.contact_closure import contact_closure
from analysis.fit import joint, steps
from analysis.fit.blocks import prior_rows
from analysis.fit.campaign_fit import heldout_folds
from analysis.fit.problem import JointProblem

Part = tuple[str, str]
"""(family, scope) of columns; the scope ``shot`` gives every shot its own coefficients."""
Equations = tuple[Array, Array]
"""Matrix and vector."""
_Reduced = tuple[Array, Array, Array, Array]
"""As `_Block.reduced` returns it."""

STEERED = (RIPPLE, SLEW)
"""Families of the rig that follow the signal so closely that a step of the model asks them."""
OF_SLOPES = ("cell", "gain", "pitch", "stiffness")
"""Families whose columns are slopes of the model."""
STEER_STEP = 1e-4
"""Of the largest signal, to see how they follow: large beside rounding, small beside a ripple."""
OWN_WIDTH = 3.0
"""Prior standard deviation of a single shot's coefficient. A choice: columns are scaled so that one
is usual, and the shot's own samples are to decide."""
WIDTHS = (0.5, 0.1, 0.02, 4e-3)
"""How large shared ones may be, in steps of five; the one that holds best on other shots counts."""
ROUNDS, STEERED_ROUNDS, FOLD_ROUNDS, TURNS = 6, 20, 3, 2
"""Steps of a search, those of `STEERED` families short and cheap; turns of own numbers and shared
ones. Chosen by trial."""
FIRST_DAMPING, LEAST_DAMPING = 1e-4, 1e-9
"""Levenberg and Marquardt's, of the diagonal; the least no longer shortens a step."""
FAILURES = 4
"""Steps that may fail one after the other: the damping has then grown by 1e8."""
AGREED = 3e-4
"""Relative fall of the cost at which a search ends. Chosen so that an error moves by half of that,
a sixth of what one discrepancy more must bring, see ``CRITERIA.heldout_change``."""
SETTLE_STEPS = 4
"""Of the shots' own numbers, the shared ones held. Chosen by trial."""
FORCE = "force_"
"""What the parts of a free contact force are called before their form."""
FORCE_WIDTH = 1.0
"""Prior standard deviation of a free force's coefficients: one is Hertz's own force once more."""
FORCE_STEPS = 8
"""Of a fit with a free force, which is linear in its coefficients. Chosen by trial."""


@dataclass(frozen=True)
class Learned:
    """A discrepancy and what it repairs."""

    parts: tuple[Part, ...]
    problem: JointProblem
    """The model that the columns were added to, a free force included."""
    fitted: joint.Fitted
    """Where that model ended."""
    coefficients: dict[str, float]
    """By label, with its group."""
    by_shot: dict[str, Array]
    """Label to the coefficients that every shot has for itself, shape (shots,)."""
    added: list[Array]
    """What it adds to each shot. [unit of the signal]"""
    residual: list[Array]
    """What is left of each shot. [unit of the signal]"""
    chi2: float
    """Whitened squares left."""
    rms: float
    """Pooled residual. [unit of the signal]"""
    heldout_rms: float | None
    """The same on shots that the discrepancy was not learned on. [unit of the signal]"""

    @property
    def family(self) -> str:
        """Return the families, joined."""
        return "+".join(f for f, _ in self.parts)

    @property
    def scope(self) -> str:
        """Return the groups, joined."""
        return "+".join(s for _, s in self.parts)


@dataclass(frozen=True)
class _Training:
    """Shots that a discrepancy is learned on, and what it consists of."""

    problem: JointProblem
    parts: tuple[Part, ...]  # those with shared coefficients first
    scale: Scale  # the columns' sizes, kept while the discrepancy is learned
    labels: list[str]  # of the w shared coefficients, with their groups
    own_labels: list[str]  # of the o coefficients of each shot
    maps: list[tuple[NDArray[np.intp], Array]]
    """For each shot: the k shared coefficients it has, and how each moves its columns, (a, k)."""
    width: float  # how large a shared coefficient is thought of

    def part(self, rows: Sequence[int]) -> _Training:
        """Return the same of some of the shots."""
        problem = self.problem.with_shots(rows)
        return dataclasses.replace(self, problem=problem, maps=[self.maps[i] for i in rows])


@dataclass(frozen=True)
class _Point:
    """Where a search is."""

    theta: Array  # globals, shape (g,)
    nuisances: Array  # of the base model, shape (shots, p)
    shared: Array  # coefficients of the discrepancy, shape (w,)
    own: Array  # coefficients of each shot, shape (shots, o)

    def of(self, rows: Sequence[int]) -> _Point:
        at = list(rows)
        return _Point(self.theta, self.nuisances[at], self.shared, self.own[at])

    def with_own(self, step: Array) -> _Point:
        """Return the point after a step of the shots' own numbers, coefficients first."""
        o = self.own.shape[1]
        own, nuisances = self.own + step[:, :o], self.nuisances + step[:, o:]
        return dataclasses.replace(self, own=own, nuisances=nuisances)


@dataclass(frozen=True)
class _Block:
    """One shot at a point. Its slopes take most of the time: they are computed where asked for."""

    parts: tuple[Part, ...]
    view: View  # with the model's slopes where columns are made of these
    linear: Sequence[Array] | None  # slopes of signal and rebound ratio, in the same case
    rebound: float
    chain: Array  # shared local parameters by the globals, shape (s, g)
    at: NDArray[np.intp]  # which of all globals and shared coefficients the shot has
    weights: Array  # its a shared columns by the coefficients among these, shape (a, k)
    numbers: Array  # coefficients of its columns, shape (a + o,)
    single: list[Array]  # its columns with coefficients of its own; the others are too many to keep
    residual: Array  # [unit of the signal]
    added: Array  # by the discrepancy. [unit of the signal]
    chi2: float
    cost: float  # whitened squares with what is known of the shot's own numbers

    @cached_property
    def of_all(self) -> Equations:
        """Return the whitened normal equations: what is shared, then what is the shot's own."""
        return self._normal(first=0)

    @cached_property
    def of_own(self) -> Equations:
        """Return the same with everything shared held."""
        return self._normal(first=self.chain.shape[0])

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """Return the derivatives of the signal, discrepancy included, and of the rebound ratio."""
        view = self.view
        slopes, rebound = self.linear or view.model.linearise(view.local, view.item.frame)[1:]
        if not (any(family in STEERED for family, _ in self.parts) and np.any(self.numbers)):
            return slopes, rebound
        steered, end = slopes.copy(), 0
        for part, here in zip(self.parts, _columns(view, self.parts), strict=True):
            begin, end = end, end + here.shape[1]
            size = self.numbers[begin:end]
            if part[0] not in STEERED or not np.any(size):
                continue
            for at, slope in enumerate(slopes.T):
                most = float(np.max(np.abs(slope)))
                if most == 0.0 or at == self.chain.shape[0] + BASELINE:
                    continue  # a family of the signal does not see the baseline
                step = STEER_STEP * view.scale.top / most
                moved = dataclasses.replace(view, clean=view.clean + step * slope)
                steered[:, at] += (_columns(moved, [part])[0] - here) @ size / step
        return steered, rebound

    def _normal(self, first: int) -> Equations:
        """Return the normal equations of parameters from the first on, with columns between."""
        view, s, a = self.view, self.chain.shape[0], self.weights.shape[0]
        slopes, rebound = self._slopes
        own, begin = self.numbers[a:], 0 if first else s + a
        common = [] if first else _columns(view, [part for part in self.parts if part[1] != "shot"])
        columns = [slopes[:, first:s], *common, *self.single, slopes[:, s:]]
        rows = [*(c.T for c in columns), self.residual]
        with np.errstate(over="ignore", invalid="ignore"):
            white = view.item.whiten(np.vstack(rows).T)
            products = white.T @ white
        matrix, vector = products[:-1, :-1], products[:-1, -1]
        values, gradients = prior_rows(view.model, view.item, view.local, self.rebound, rebound)
        known = np.array(gradients)[:, first:]
        at = np.r_[: s - first, begin + own.size : vector.size]
        matrix[np.ix_(at, at)] += known.T @ known
        vector[at] -= known.T @ values
        mine = np.arange(begin, begin + own.size)
        matrix[mine, mine] += OWN_WIDTH**-2
        vector[mine] -= own * OWN_WIDTH**-2
        return matrix, vector

    def reduced(self, damping: float) -> _Reduced:
        """Return matrix and vector of what is shared, and ``back`` and ``own``.

        All of the shot's own numbers are eliminated; they step by ``own - back @ step``.
        """
        wide, (matrix, vector) = block_diag(self.chain, self.weights), self.of_all
        k = wide.shape[0]
        cross = matrix[:k, k:]
        right = np.column_stack([cross.T, vector[k:]])
        solved = np.asarray(np.linalg.solve(_damped(matrix[k:, k:], damping), right))
        back, own = solved[:, :-1], solved[:, -1]
        inner, load = matrix[:k, :k] - cross @ back, vector[:k] - cross @ own
        return wide.T @ inner @ wide, wide.T @ load, back @ wide, own


@dataclass(frozen=True)
class _Reached:
    """A point with its blocks and its cost."""

    point: _Point
    blocks: list[_Block]
    cost: float

    def of(self, training: _Training, rows: Sequence[int]) -> _Reached:
        """Return the same of some of the shots, with what is known of their slopes."""
        return _with_cost(training, self.point.of(rows), [self.blocks[i] for i in rows])


def learn(
    problem: JointProblem, fitted: joint.Fitted, parts: Sequence[Part], scale: Scale | None = None
) -> Learned | None:
    """Fit a discrepancy and a model at its best to each other; None where no step helps.

    The scale holds the sizes of the columns, with the frequencies of tuned families.
    """
    sizes = tuned(problem, fitted, scale or scale_of(problem, fitted), [f for f, _ in parts])
    training = _training(problem, fitted, parts, sizes)
    own = np.zeros((len(problem.shots), len(training.own_labels)))
    begin = _Point(fitted.theta, fitted.nuisances, np.zeros(len(training.labels)), own)
    start = _reach(training, begin)
    if start is None:
        return None
    folds = heldout_folds(problem)
    if folds and training.labels:
        training = dataclasses.replace(training, width=_best_width(training, start, folds))
    rounds = STEERED_ROUNDS if any(f in STEERED for f, _ in parts) else ROUNDS
    end = start
    for _ in range(TURNS if training.own_labels else 1):
        if training.own_labels:  # these may be anywhere: shot by shot first, each as it fares best
            end = _settled(training, end)
        end = _descend(training, end, rounds)
    if not end.cost < start.cost:
        return None
    point, residual = end.point, [b.residual for b in end.blocks]
    return Learned(
        parts=tuple(parts),
        problem=problem,
        fitted=joint.Fitted(
            point.theta, point.nuisances, fitted.blocks, fitted.covariance, end.cost, 0, True
        ),
        coefficients=dict(zip(training.labels, map(float, point.shared), strict=True)),
        by_shot=dict(zip(training.own_labels, point.own.T, strict=True)),
        added=[b.added for b in end.blocks],
        residual=residual,
        chi2=sum(b.chi2 for b in end.blocks),
        rms=_rms(residual),
        heldout_rms=_heldout(training, start, end, folds),
    )


def _rms(residual: Sequence[Array]) -> float:
    return math.sqrt(sum(float(r @ r) for r in residual) / sum(r.size for r in residual))


def _heldout(
    training: _Training, start: _Reached, end: _Reached, folds: Sequence[Sequence[int]]
) -> float | None:
    """Return the residual of shots that neither globals nor shared coefficients were fitted to."""
    left: list[Array] = []
    for fold in folds:
        kept = [i for i in range(len(end.blocks)) if i not in fold]
        others = training.part(kept)
        begin = end.of(others, kept)
        learned = _descend(others, begin, FOLD_ROUNDS)
        if learned is begin and training.labels:
            # what the held-out shots had a say in would still stand: once more, from before
            begin = start.of(others, kept)
            learned = _descend(others, begin, ROUNDS)
            if learned is begin:
                return None
        known = dataclasses.replace(
            end.point.of(fold), theta=learned.point.theta, shared=learned.point.shared
        )
        held = _reach(training.part(fold), known)
        if held is None:
            return None
        left += [b.residual for b in _settled(training.part(fold), held).blocks]
    return _rms(left) if left else None


def learn_force(
    problem: JointProblem,
    fitted: joint.Fitted,
    linearised: Linearised,
    *,
    forms: Sequence[str],
    scope: str,
) -> Learned | None:
    """Fit a contact force of free form, integrated as any contact law is; None where it cannot be.

    The forms are of ``analysis.effects.contact_closure.FORMS``; the scope is rig, surface or
    sphere.
    """
    scale = scale_of(problem, fitted)
    wide, found = problem, fitted
    form_of = {}
    for form in forms:
        effect = contact_closure(form, scale.indentation_m, scale.speed_m_per_s, scope)
        form_of[effect.id] = form
        wide, theta, nuisances = extended(wide, found, effect, {})
        for j in range(found.theta.size, theta.size):
            wide.prior_precision[j, j] = FORCE_WIDTH**-2
        found = joint.fit(wide, nuisances, theta=theta, max_iterations=FORCE_STEPS)
        if found.failed:
            return None
    residual = []
    for item, nuisance in zip(wide.shots, found.nuisances, strict=True):
        shared, _ = wide.shared_local(item, found.theta)
        seen = wide.model.predict(np.concatenate([shared, nuisance]), item.frame)
        residual.append(item.window.signal - seen.signal)
    added = zip(wide.names, found.theta, strict=True)
    return Learned(
        parts=tuple((FORCE + form, scope) for form in forms),
        problem=wide,
        fitted=found,
        coefficients={
            f"{form_of[name.owner]}.{name.short}": float(value)
            for name, value in list(added)[len(problem.names) :]
        },
        by_shot={},
        added=[old.residual - r for old, r in zip(linearised.shots, residual, strict=True)],
        residual=residual,
        chi2=sum(b.chi2 for b in found.blocks),
        rms=_rms(residual),
        heldout_rms=heldout_or_none(wide, found),
    )


def on_top(first: Learned, second: Learned) -> Learned:
    """Return a force and what was learned with its ``problem`` and ``fitted`` as one."""
    before = [a + r for a, r in zip(first.added, first.residual, strict=True)]
    return dataclasses.replace(
        second,
        parts=(*first.parts, *second.parts),
        coefficients=first.coefficients | second.coefficients,
        added=[b - r for b, r in zip(before, second.residual, strict=True)],
    )


def _columns(view: View, parts: Sequence[Part]) -> list[Array]:
    return [family_columns(view, family)[1] for family, _ in parts]


def _training(
    problem: JointProblem, fitted: joint.Fitted, parts: Sequence[Part], scale: Scale
) -> _Training:
    """Return what a discrepancy consists of for all shots of a campaign."""
    model, item = problem.model, problem.shots[0]
    shared, _ = problem.shared_local(item, fitted.theta)
    local = np.concatenate([shared, fitted.nuisances[0]])
    found, slopes, _ = model.linearise(local, item.frame)
    clean = found.signal - local[shared.size + BASELINE]
    view = View(model, item, local, clean, slopes, scale)
    parts = sorted(parts, key=lambda part: part[1] == "shot")
    labels: list[str] = []
    own: list[str] = []
    pieces: list[list[Array]] = [[np.zeros((0, 0))] for _ in problem.shots]
    for family, scope in parts:
        names = family_columns(view, family)[0]
        if scope == "shot":
            own += names
            continue
        by_shot = [dict(groups_) for groups_ in groups(problem, scope)]
        distinct = sorted({group for groups_ in by_shot for group in groups_})
        for piece, weights in zip(pieces, by_shot, strict=True):
            row = np.array([[weights.get(group, 0.0) for group in distinct]], dtype=np.float64)
            piece.append(np.asarray(np.kron(row, np.eye(len(names))), dtype=np.float64))
        labels += [f"{n}{f' [{group}]' if group else ''}" for group in distinct for n in names]
    maps = []
    for piece in pieces:
        whole = np.asarray(block_diag(*piece), dtype=np.float64)
        at = np.flatnonzero(whole.any(axis=0))
        maps.append((at, whole[:, at]))
    return _Training(problem, tuple(parts), scale, labels, own, maps, WIDTHS[0])


def _block(training: _Training, point: _Point, row: int) -> _Block | None:
    """Return one shot at a point, None where there is no trace."""
    problem = training.problem
    problem.checkpoint()
    model, item = problem.model, problem.shots[row]
    values, chain = problem.shared_local(item, point.theta)
    local = np.concatenate([values, point.nuisances[row]])
    if not np.all(np.isfinite(local)):
        return None
    linear = None
    if any(family in OF_SLOPES for family, _ in training.parts):
        found, *linear = model.linearise(local, item.frame)
    else:
        found = model.predict(local, item.frame)
    if not np.all(np.isfinite(found.signal)):
        return None
    clean = found.signal - local[values.size + BASELINE]
    slopes = linear[0] if linear else np.zeros((clean.size, 0))
    view = View(model, item, local, clean, slopes, training.scale)
    coefficients, weights = training.maps[row]
    own = point.own[row]
    numbers = np.concatenate([weights @ point.shared[coefficients], own])
    added, begin = np.zeros(clean.size), 0
    all_columns = _columns(view, training.parts)
    for columns in all_columns:
        added += columns @ numbers[begin : begin + columns.shape[1]]
        begin += columns.shape[1]
    single = [c for c, part in zip(all_columns, training.parts, strict=True) if part[1] == "shot"]
    residual = item.window.signal - found.signal - added
    known, _ = prior_rows(model, item, local, found.rebound_ratio, np.zeros(local.size))
    with np.errstate(over="ignore", invalid="ignore"):
        chi2 = float(np.sum(np.square(item.whiten(residual))))
    if not math.isfinite(chi2):
        return None
    cost = chi2 + float(np.sum(np.square(known))) + float(own @ own) * OWN_WIDTH**-2
    at = np.concatenate([np.arange(point.theta.size), point.theta.size + coefficients])
    return _Block(
        training.parts, view, linear, found.rebound_ratio, chain, at, weights, numbers, single,
        residual, added, chi2, cost,
    )  # fmt: skip


@np.errstate(over="ignore", invalid="ignore")  # of a motion that ran away
def _reach(training: _Training, point: _Point) -> _Reached | None:
    """Return a point with its cost, None where there is no trace."""
    blocks = []
    for row in range(len(training.problem.shots)):
        one = _block(training, point, row)
        if one is None:
            return None
        blocks.append(one)
    return _with_cost(training, point, blocks)


def _with_cost(training: _Training, point: _Point, blocks: list[_Block]) -> _Reached:
    away = point.theta - training.problem.prior_mean
    cost = sum(b.cost for b in blocks) + float(away @ training.problem.prior_precision @ away)
    return _Reached(point, blocks, cost + float(point.shared @ point.shared) * training.width**-2)


def _damped(matrix: Array, damping: float) -> Array:
    found = matrix.copy()
    found[np.diag_indices_from(found)] *= 1.0 + damping
    return found


def _normal(found: _Reached, parts: Sequence[_Reduced], rows: Sequence[int]) -> Equations:
    """Return the normal equations of globals and coefficients over some shots, without priors."""
    size = found.point.theta.size + found.point.shared.size
    matrix, vector = np.zeros((size, size)), np.zeros(size)
    for row in rows:
        at = found.blocks[row].at
        matrix[np.ix_(at, at)] += parts[row][0]
        vector[at] += parts[row][1]
    return matrix, vector


def _with_priors(
    training: _Training, point: _Point, matrix: Array, vector: Array, width: float
) -> Equations:
    g, precision = point.theta.size, training.problem.prior_precision
    matrix, vector = matrix.copy(), vector.copy()
    matrix[:g, :g] += precision
    vector[:g] -= precision @ (point.theta - training.problem.prior_mean)
    at = np.arange(g, matrix.shape[0])
    matrix[at, at] += width**-2
    vector[g:] -= point.shared * width**-2
    return matrix, vector


def _best_width(training: _Training, found: _Reached, folds: Sequence[Sequence[int]]) -> float:
    """Return the one of `WIDTHS` whose coefficients hold best on other shots, to first order."""
    parts = [b.reduced(0.0) for b in found.blocks]
    pieces = [_normal(found, parts, fold) for fold in folds]
    whole = sum((m for m, _ in pieces), start=np.zeros(()))
    load = sum((v for _, v in pieces), start=np.zeros(()))
    falls = dict.fromkeys(WIDTHS, 0.0)
    g = found.point.theta.size
    for inside, own in pieces:
        rest, pull = whole - inside, load - own
        least, force = _with_priors(training, found.point, rest, pull, 1.0)
        base = np.linalg.solve(least[:g, :g], force[:g])
        without = float(2 * base @ own[:g] - base @ inside[:g, :g] @ base)
        for width in WIDTHS:
            x = np.linalg.solve(*_with_priors(training, found.point, rest, pull, width))
            falls[width] += float(2 * x @ own - x @ inside @ x) - without
    return max(falls, key=lambda width: falls[width])


def _descend(training: _Training, here: _Reached, rounds: int) -> _Reached:
    """Return where model and discrepancy agree after at most so many steps, failed ones included.

    Never worse than here.
    """
    damping, failed = FIRST_DAMPING, 0
    g = here.point.theta.size
    for _ in range(rounds):
        parts = [b.reduced(damping) for b in here.blocks]
        normal = _normal(here, parts, range(len(parts)))
        matrix, vector = _with_priors(training, here.point, *normal, training.width)
        matrix[np.diag_indices(g)] *= 1.0 + damping
        step = np.asarray(np.linalg.solve(matrix, vector), dtype=np.float64)
        mine = [
            own - back @ step[b.at] for b, (_, _, back, own) in zip(here.blocks, parts, strict=True)
        ]
        theta = steps.along(training.problem, here.point.theta, step[:g])
        there = dataclasses.replace(here.point, theta=theta, shared=here.point.shared + step[g:])
        ahead = _reach(training, there.with_own(np.array(mine)))
        if ahead is None or not ahead.cost < here.cost:
            failed += 1
            damping = max(100.0 * damping, 1e-3)
            if failed >= FAILURES:
                break
            continue
        small = here.cost - ahead.cost < AGREED * here.cost
        here, failed, damping = ahead, 0, max(damping / 10, LEAST_DAMPING)
        if small:
            break
    return here


def _settled(training: _Training, here: _Reached) -> _Reached:
    """Return each shot's own numbers at their best, everything shared kept."""
    damping = np.full(len(here.blocks), FIRST_DAMPING)
    for _ in range(SETTLE_STEPS):
        steps_of_own = [
            np.linalg.solve(_damped(b.of_own[0], float(d)), b.of_own[1])
            for b, d in zip(here.blocks, damping, strict=True)
        ]
        ahead = _reach(training, here.point.with_own(np.array(steps_of_own)))
        if ahead is None:
            damping *= 100.0
            continue
        pairs = list(zip(ahead.blocks, here.blocks, strict=True))
        better = np.array([new.cost < old.cost for new, old in pairs])
        fall = here.cost - ahead.cost
        point = dataclasses.replace(
            here.point,
            nuisances=np.where(better[:, None], ahead.point.nuisances, here.point.nuisances),
            own=np.where(better[:, None], ahead.point.own, here.point.own),
        )
        blocks = [new if new.cost < old.cost else old for new, old in pairs]
        here = _with_cost(training, point, blocks)
        damping = np.where(better, np.maximum(damping / 10, LEAST_DAMPING), damping * 100.0)
        if better.all() and fall < AGREED * here.cost:
            break
    return here
