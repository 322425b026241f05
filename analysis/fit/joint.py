"""Levenberg-Marquardt on a campaign: few shared parameters, four nuisances a shot.

The normal equations have the arrow structure of bundle adjustment. Each shot's nuisances (speed,
restitution, touch-down, baseline) are eliminated by a Schur complement inside the shot, so cost and
memory grow linearly with the number of shots and no shot's Jacobian is kept.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from analysis.aliases import Array
from analysis.fit.blocks import ShotBlock, linearise_shot, shot_cost
from analysis.fit.cores import T
from analysis.fit.over_shots import for_each_shot
from analysis.fit.problem import JointProblem
from analysis.fit.steps import along

MAX_ITERATIONS = 120
STEP_TOLERANCE = 5e-3
"""Converged when the next step would move nothing, nor any sum of parameters, by more than this
share of its standard uncertainty: the fall of chi2 that a step promises is its squared length in
units of the covariance, and no linear combination is moved by more of its own uncertainties.
Where the residual has r times the noise's variance, the uncertainty is wider by the root of r, and
so is the share: the minimum of a model that is wrong means less. But a step that promises as much
as a fit that creeps makes in all is always made: at r of 36 000 a third of all squares was none."""
ROUGH_TOLERANCE = 0.1
"""The same for uncertainties that come from a misfit: these are good to tens of per cent, so that a
tenth of one moves no digit that they carry."""
SEARCH_TOLERANCE = 0.3
"""The same where models are only compared. Derived: what a step then still promises, 0.09 squares,
is a hundredth of what two effects must differ by to be told apart."""
COST_TOLERANCE = 1e-9
GOOD_STEP = 0.1
"""Share of the promised fall above which the next step is likely to succeed as well. Derived: to
linearise it at once pays if it succeeds more often than 2/3, as its cost takes a third of the time.
Measured on 1612 steps: 0.81 to 0.93 in each tenth of the share, but 0.56 in the lowest."""
START_DAMPING, LEAST_DAMPING = 1e-3, 1e-9
MOST_EASED = 0.1
"""Least factor on the damping from one step to the next. Derived: a descent with short steps is
nearly free after three good ones; by Nielsen's third it takes seven."""
GROWTH = 2.0
"""Factor on the damping after a refused step, and on itself after each further one: Nielsen's."""
SHORT_STEPS = 10.0
"""Damping of a second descent: along each parameter its first step is at most 1 / 11 of the linear
model's."""
HOPELESS = 10.0
"""Variance of the residual over the noise's above which a shot's own parameters mean nothing.
Measured: sound fits that ended at a rebound too fast left 1.02 to 1.5, models that lack physics 100
to 11 000, and for those a second descent would only double the cost."""
CREEP_STEPS, CREEP_SHARE = 20, 0.01
"""The fit of a model that is far off stops when its squares fell by less than this share in so many
steps. Measured on eight campaigns in which the base left 5e6 to 2e9 squares: no fit that came near
the shots was hopeless for 20 steps; 57 were, ended so, and 35 of these fell by less than this."""
FAR_OFF = 3.0
"""Variance of the residual over the noise's above which a fit that creeps stops, where models are
only compared. Derived: at a hundredth in 20 steps noise is then 2200 steps away, 18 times as many
as any fit gets."""
NEARLY_FREE = 1e-2
"""Damping below which a step is within a hundredth as long as the linear model has it."""
LEAST_OF_A_TEAM = 18
"""Shots that are fitted by several processes. Derived: to begin a helper takes 6.6 ms; two cores
spared 1.0, 2.1 and 7.8 ms at each point of 9, 18 and 54 shots of the cheapest model, so that over
the 10 points of a fit 18 shots save three times as much as it costs, and 9 hardly more."""
SUM_ROUNDING = 1e-12
"""Sums in different orders differ by less."""
STALLED_DAMPING = 1e10
STALLED_GAIN = 0.05
"""Fall of chi2 that a full step still promises where none succeeds, below which it is a minimum."""


@dataclass(frozen=True)
class Fitted:
    """Where the iteration ended."""

    theta: Array
    """Globals, shape (g,)."""
    nuisances: Array
    """Shape (shots, 4)."""
    blocks: list[ShotBlock]
    """At the end point."""
    covariance: Array
    """Of the globals, shape (g, g): noise as estimated, nuisances marginalised."""
    cost: float
    """Sum of whitened squares and priors."""
    iterations: int
    """Accepted and rejected steps."""
    converged: bool

    @property
    def failed(self) -> bool:
        """Whether the model could not be evaluated: no blocks, and an infinite cost."""
        return not self.blocks


@dataclass(frozen=True)
class _Schur:
    """One shot with its nuisances eliminated."""

    matrix: Array
    vector: Array
    back: Array
    own: Array


def _alike(blocks: Sequence[ShotBlock]) -> list[list[int]]:
    """Return the places of blocks of one shape each: these are worked on together."""
    found: dict[tuple[int, int], list[int]] = {}
    for row, block in enumerate(blocks):
        found.setdefault((block.chain.shape[0], block.vector.size), []).append(row)
    return list(found.values())


def _eliminate(blocks: Sequence[ShotBlock], damping: float) -> list[_Schur]:
    """Return each shot with its nuisances eliminated."""
    found: dict[int, _Schur] = {}
    for rows in _alike(blocks):
        s = blocks[rows[0]].chain.shape[0]
        chain = np.array([blocks[i].chain for i in rows])
        matrix = np.array([blocks[i].matrix for i in rows])
        vector = np.array([blocks[i].vector for i in rows])[:, :, None]
        across = chain.transpose(0, 2, 1)
        inner = matrix[:, s:, s:].copy()
        own_size = range(inner.shape[1])
        inner[:, own_size, own_size] *= 1 + damping
        cross = matrix[:, :s, s:]
        solved = solve_normal(inner, np.concatenate([vector[:, s:], matrix[:, s:, :s]], axis=2))
        own, back = solved[:, :, :1], solved[:, :, 1:]
        left = across @ (matrix[:, :s, :s] - cross @ back) @ chain
        load = across @ (vector[:, :s] - cross @ own)
        parts = zip(left, load[:, :, 0], back @ chain, own[:, :, 0], strict=True)
        found.update(zip(rows, (_Schur(*part) for part in parts), strict=True))
    return [found[row] for row in range(len(blocks))]


def solve_normal(matrix: Array, right: Array) -> Array:
    """Return the solutions of normal equations; 0 of a number that nothing fixes.

    So it is with the numbers of a pulse that has left its window: the rest is solved all the same.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        size = np.sqrt(np.diagonal(matrix, axis1=-2, axis2=-1))[..., None]
        size = np.where(size > 0.0, size, 1.0)
        units = size * size.swapaxes(-1, -2)
        return np.asarray(np.linalg.pinv(matrix / units, hermitian=True) / units @ right)


def _gather(
    problem: JointProblem, blocks: Sequence[ShotBlock], theta: Array, damping: float
) -> tuple[Array, Array, list[_Schur]]:
    matrix = problem.prior_precision.copy()
    vector = -problem.prior_precision @ (theta - problem.prior_mean)
    parts = _eliminate(blocks, damping)
    for part in parts:
        matrix += part.matrix
        vector += part.vector
    return matrix, vector, parts


def normal_equations(problem: JointProblem, fitted: Fitted) -> tuple[Array, Array, list[_Schur]]:
    """Return the globals' normal equations at a solution, whole and by shot.

    Priors are included in matrix (g, g) and vector (g,); the vector is near zero at a minimum. Each
    shot's part has its nuisances eliminated.
    """
    return _gather(problem, fitted.blocks, fitted.theta, 0.0)


def least_squares_nearby(problem: JointProblem, blocks: Sequence[ShotBlock], theta: Array) -> float:
    """Return the least squares with priors that a problem has if it is linear around a point.

    A number that nothing fixes stays where it is.
    """
    here = _prior_cost(problem, theta) + sum(block.cost for block in blocks)
    return here - _linear_fall(problem, blocks, theta, solve_normal)


def _prior_cost(problem: JointProblem, theta: Array) -> float:
    d = theta - problem.prior_mean
    return float(d @ problem.prior_precision @ d)


class _NoTraceError(Exception):
    """A shot has no trace here; it ends a round over the shots."""


@dataclass(frozen=True)
class _Point:
    """Where all shots are asked for."""

    theta: Array
    nuisances: Array
    stop_above: float | None = None
    """None for their normal equations; else for their costs, as long as these stay below."""


@dataclass(frozen=True)
class _AllShots:
    """The shots of a problem at one point after the other."""

    problem: JointProblem
    ask: Callable[[_Point], list[Any]] | None = None
    """Asks a team of processes; None in one process."""

    def blocks(self, theta: Array, nuisances: Array) -> list[ShotBlock] | None:
        """Return all normal equations; None where a shot has no trace."""
        if self.ask is None:
            return _linearise_all(self.problem, theta, nuisances)
        parts = self.ask(_Point(theta, nuisances))
        return None if any(part is None for part in parts) else _dealt(parts)

    def cost(self, theta: Array, nuisances: Array, stop_above: float) -> float:
        """Return the cost, or infinity as soon as it passes ``stop_above``."""
        at = _Point(theta, nuisances, stop_above)
        parts: list[Any] = (
            [_of_member(self.problem, 0, 1, at)] if self.ask is None else self.ask(at)
        )
        if any(part is None for part in parts):
            return math.inf
        cost = _prior_cost(self.problem, theta)
        for own in _dealt(parts):
            cost += own
        return cost if cost <= stop_above else math.inf


def _dealt(parts: list[list[T]]) -> list[T]:
    """Return in order what was dealt out to parts in turn."""
    return [parts[i % len(parts)][i // len(parts)] for i in range(sum(map(len, parts)))]


def _of_member(problem: JointProblem, member: int, members: int, at: _Point) -> list[Any] | None:
    """Return what one member of a team makes of its shots; None where that is of no use."""
    found: list[Any] = []
    total = 0.0
    for row in range(member, len(problem.shots), members):
        item, nuisance = problem.shots[row], at.nuisances[row]
        if at.stop_above is None:
            block = linearise_shot(problem, item, at.theta, nuisance)
            if block is None:
                return None
            found.append(block)
            continue
        found.append(shot_cost(problem, item, at.theta, nuisance))
        total += found[-1]
        if not total <= at.stop_above * (1 + SUM_ROUNDING):
            return None
    return found


@contextlib.contextmanager
def _all_shots(problem: JointProblem, max_iterations: int) -> Iterator[_AllShots]:
    """Yield the shots, dealt out to a team where that pays: for many shots and more than a look."""
    pays = max_iterations > 0 and len(problem.shots) >= LEAST_OF_A_TEAM
    if not pays or problem.cores.count < 2:
        yield _AllShots(problem)
        return
    with problem.cores.team(partial(_of_member, problem)) as ask:
        yield _AllShots(problem, ask)


def _linearise_all(problem: JointProblem, theta: Array, nuisances: Array) -> list[ShotBlock] | None:
    def block(row: int) -> ShotBlock:
        """Return one shot's normal equations."""
        found = linearise_shot(problem, problem.shots[row], theta, nuisances[row])
        if found is None:
            raise _NoTraceError
        return found

    compiled = any(e.in_solver for e in problem.model.effects)
    try:
        return for_each_shot(block, len(problem.shots), on_all_cores=compiled)
    except _NoTraceError:
        return None


def _try_step(
    problem: JointProblem,
    all_shots: _AllShots,
    moved: tuple[Array, Array],
    cost: float,
    *,
    likely: bool,
) -> tuple[list[ShotBlock] | None, float]:
    """Return the blocks and the cost at the end of a step; None if the cost does not fall.

    A step that is likely to succeed is linearised at once. For another one the cost is computed
    first, which takes a third of the time.
    """
    if not likely and not all_shots.cost(*moved, cost) <= cost:
        return None, math.inf
    # at the edge of what can be evaluated a trace may exist and its neighbours not
    blocks = all_shots.blocks(*moved)
    if blocks is None:
        return None, math.inf
    reached = _prior_cost(problem, moved[0]) + sum(b.cost for b in blocks)
    return (blocks, reached) if reached <= cost else (None, reached)


def total_cost(problem: JointProblem, theta: Array, nuisances: Array) -> float:
    """Return the whitened squares with all priors; infinite where there is no trace."""
    return _AllShots(problem).cost(theta, nuisances, math.inf)


def promised_gain(problem: JointProblem, blocks: Sequence[ShotBlock], theta: Array) -> float:
    """Return the fall of chi2 that a linear problem would have; inf if it cannot be computed."""
    try:
        return _linear_fall(problem, blocks, theta, np.linalg.solve)
    except np.linalg.LinAlgError:
        return math.inf


def _linear_fall(
    problem: JointProblem,
    blocks: Sequence[ShotBlock],
    theta: Array,
    solve: Callable[..., Any],
) -> float:
    matrix, vector, parts = _gather(problem, blocks, theta, 0.0)
    own = (b.vector[b.chain.shape[0] :] @ p.own for b, p in zip(blocks, parts, strict=True))
    return float(vector @ solve(matrix, vector)) + float(sum(own))


def _promised_fall(
    problem: JointProblem, blocks: list[ShotBlock], theta: Array, step: Array, own: Array
) -> float:
    """Return the fall of the cost if the model were linear."""
    prior = problem.prior_precision
    fall = float(-2 * step @ prior @ (theta - problem.prior_mean) - step @ prior @ step)
    for rows in _alike(blocks):
        moved = np.array([blocks[i].chain for i in rows]) @ step
        local = np.concatenate([moved, own[rows]], axis=1)
        matrix = np.array([blocks[i].matrix for i in rows])
        vector = np.array([blocks[i].vector for i in rows])
        fall += float(np.sum((2 * vector - (matrix @ local[:, :, None])[:, :, 0]) * local))
    return fall


def _next_damping(damping: float, kept: float) -> float:
    r"""Return the damping after a step that kept some share of the fall it promised.

    .. math:: \mu \to \mu \max(0.1, 1 - (2 \rho - 1)^3)

    Source: Nielsen 1999, IMM-REP-1999-05. It hardly falls after a step that was just good: where it
    fell tenfold, every second step down a narrow valley was refused.
    """
    eased = 1.0 - (2.0 * min(kept, 1.0) - 1.0) ** 3
    return max(damping * max(MOST_EASED, eased), LEAST_DAMPING)


def _nowhere(theta: Array, nuisances: Array) -> Fitted:
    """Return the result of a fit that cannot be evaluated."""
    return Fitted(theta, nuisances, [], np.full((theta.size,) * 2, np.nan), math.inf, 0, False)


def fit(
    problem: JointProblem,
    nuisances: Array,
    *,
    theta: Array | None = None,
    max_iterations: int = MAX_ITERATIONS,
    damping: float = START_DAMPING,
    tolerance: float = STEP_TOLERANCE,
    far_off: float = HOPELESS,
    blocks: list[ShotBlock] | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Fitted:
    """Return the most probable parameters of a campaign: the end point, converged or not.

    Parameters
    ----------
    nuisances : ndarray, shape (shots, 4)
        Where the shots' nuisances start.
    theta : ndarray, shape (g,), optional
        Where the globals start; by default ``problem.start``.
    max_iterations : int
        Steps before giving up; giving up is an outcome, not an error.
    damping : float
        Of the first step; next to none where the start is known to be near.
    tolerance : float
        Share of a standard uncertainty below which a step is not worth making.
    far_off : float
        Variance of the residual over the noise's above which a fit that creeps stops.
    blocks : list of ShotBlock, optional
        At the start, where a fit has ended there.
    """
    theta = (problem.start if theta is None else theta).copy()
    nuisances = nuisances.copy()
    steps = _Steps(max_iterations, damping, tolerance, far_off, progress)
    with _all_shots(problem, max_iterations) as all_shots:
        if blocks is None:
            blocks = all_shots.blocks(theta, nuisances)
        if blocks is None:
            return _nowhere(theta, nuisances)
        begin = _Begin(theta, nuisances, blocks)
        fitted = _descend(problem, all_shots, begin, steps)
        sound = _gains_energy(problem, nuisances) or not _gains_energy(problem, fitted.nuisances)
        if sound or is_hopeless(problem, fitted.cost):
            return fitted
        shorter = replace(steps, damping=SHORT_STEPS)
        again = _descend(problem, all_shots, begin, shorter)
        return again if again.cost < fitted.cost else fitted


fit_to_compare = partial(fit, tolerance=SEARCH_TOLERANCE, far_off=FAR_OFF)
"""`fit` where models are only compared."""


def is_hopeless(problem: JointProblem, cost: float, *, widened: float = 1.0) -> bool:
    """Tell whether a model is so far from the shots that their own parameters mean nothing.

    ``widened`` is the factor on the noise's variance that the cost was computed with.
    """
    return cost * widened > HOPELESS * sum(item.expected_squares for item in problem.shots)


def _gains_energy(problem: JointProblem, nuisances: Array) -> bool:
    """Tell whether a contact gives energy, which no contact does.

    A pulse is fitted nearly as well by a slower sphere that rebounds faster than it came, and a
    long first step may carry a shot there.
    """
    return bool((nuisances[:, problem.model.nuisances.index("ln_e")] > 0).any())


@dataclass(frozen=True)
class _Steps:
    """How a descent goes, as `fit` is told."""

    most: int
    damping: float
    tolerance: float
    far_off: float
    progress: Callable[[str, float], None] | None


@dataclass(frozen=True)
class _Begin:
    """Where a descent begins."""

    theta: Array
    nuisances: Array
    blocks: list[ShotBlock]


def _descend(problem: JointProblem, all_shots: _AllShots, begin: _Begin, steps: _Steps) -> Fitted:
    """Return the minimum that lies below a point."""
    theta, nuisances, blocks = begin.theta, begin.nuisances, begin.blocks
    damping, growth = steps.damping, GROWTH
    converged, iteration, likely = False, 0, damping <= LEAST_DAMPING
    cost = _prior_cost(problem, theta) + sum(b.cost for b in blocks)
    samples = sum(item.expected_squares for item in problem.shots)
    passed: list[float] = []
    while not converged and iteration < steps.most:
        iteration += 1
        creeps = len(passed) >= CREEP_STEPS and passed[-CREEP_STEPS] - cost < CREEP_SHARE * cost
        if creeps and cost > steps.far_off * samples:
            break
        passed.append(cost)
        try:
            matrix, vector, parts = _gather(problem, blocks, theta, damping)
            damped = matrix.copy()
            damped[np.diag_indices_from(damped)] *= 1 + damping
            step = np.asarray(np.linalg.solve(damped, vector), dtype=np.float64)
        except np.linalg.LinAlgError:
            return _nowhere(theta, nuisances)  # a shared number that no shot fixes
        own = np.array([p.own - p.back @ step for p in parts])
        promised = _promised_fall(problem, blocks, theta, step, own)
        wide = steps.tolerance * max(1.0, cost / samples)
        enough = min(wide, math.sqrt(CREEP_SHARE * cost)) ** 2  # a square of all costs overflows
        if promised < enough and (
            damping < NEARLY_FREE
            or promised_gain(problem, blocks, theta) < max(enough, STALLED_GAIN)
        ):
            converged = True
            break
        moved_to = along(problem, theta, step)
        next_blocks, new_cost = _try_step(
            problem, all_shots, (moved_to, nuisances + own), cost, likely=likely
        )
        if next_blocks is not None:
            theta, nuisances, blocks = moved_to, nuisances + own, next_blocks
            small = cost - new_cost <= COST_TOLERANCE * max(cost, 1.0)
            converged = small and damping < NEARLY_FREE
            kept = (cost - new_cost) / max(promised, 1e-300)
            damping, growth, likely = _next_damping(damping, kept), GROWTH, kept > GOOD_STEP
            cost = new_cost
        else:
            likely = False
            damping, growth = max(damping * growth, 1e-6), GROWTH * growth
            if damping > STALLED_DAMPING:
                # no step of any length helps: the minimum to rounding, or an edge
                converged = promised_gain(problem, blocks, theta) < STALLED_GAIN
                break
        if steps.progress is not None:
            steps.progress("joint fit", min(0.95, iteration / 12))
    try:
        matrix, _, _ = _gather(problem, blocks, theta, 0.0)
        covariance = np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return _nowhere(theta, nuisances)  # only damping kept it in place
    return Fitted(theta, nuisances, blocks, covariance, cost, iteration, converged)


def nuisance_covariance(problem: JointProblem, fitted: Fitted, row: int) -> Array:
    """Return the covariance of one shot's nuisances, globals' uncertainty included.

    Shape (4, 4), in the order of ``NUISANCE``; infinite where the shot determines none.
    """
    block = fitted.blocks[row]
    s = block.chain.shape[0]
    try:
        inner = np.linalg.inv(block.matrix[s:, s:])
    except np.linalg.LinAlgError:
        return np.diag(np.full(block.matrix.shape[0] - s, math.inf))
    back = inner @ block.matrix[s:, :s] @ block.chain
    return np.asarray(inner + back @ fitted.covariance @ back.T)
