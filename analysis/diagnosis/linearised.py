r"""The linearisation: a fitted campaign, linearised once with every column anybody will ask about.

For each shot the whitened normal equations of

    shared parameters | columns | the shot's nuisances

are formed and the nuisances eliminated. What is left is a small matrix a shot; from these, any set
of columns with any group (rig, surface, sphere, pair, height, order in time) can be solved for,
with and without some shots, without touching a trace again. So tests, upper bounds and held-out
errors of hundreds of hypotheses cost milliseconds, at the price of being first order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.stats import chi2 as chi2_distribution

from analysis.aliases import Array
from analysis.diagnosis.basis.families import (
    BASELINE,
    Scale,
    View,
    family_columns,
    scale_of,
    tuned,
)
from analysis.diagnosis.basis.form_error import Discrepancy
from analysis.diagnosis.basis.groupings import Sizes, Weights, groups
from analysis.diagnosis.basis.proposals import Proposal, column, rescoped
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.marginal_likelihood import log_det
from analysis.effects.acts_on import KINDS
from analysis.fit.blocks import prior_rows
from analysis.fit.inputs import LAW, STATED
from analysis.fit.joint import Fitted, solve_normal
from analysis.fit.problem import FitShot, JointProblem
from analysis.model.impact_model import ImpactModel

Families = dict[str, tuple[list[int], list[str]]]
"""Positions of each family's columns, and their labels."""
_Way = tuple[Array, Array, Array, Array]
"""How one shot follows the globals, its own p parameters with them: derivatives by s shared and own
parameters, (n, s + p), the same whitened, the step of its own if nothing else moves, (p,), and what
that loses with a step of the shared ones, (p, s)."""

GENERIC = (
    "response", "static", "dynamic", "locked", "contact", "loss", "cell", "speed", "alternate",
    "baseline",
)  # fmt: skip
"""Families that every residual is asked along."""
PARTS = {
    "ringing": ("response", ("ring",)),
    "memory": ("response", ("lag", "slope", "curvature", "decay")),
    "quick": ("response", ("slope", "curvature", "lag 2 ", "lag 4 ", "lag 6 ")),
    "bend": ("static", ("square", "cube")),
    "top": ("static", ("top",)),
    "zero": ("curve", ("at -0.02", "at -0.006", "at -0.002", "at 0 ", "at 0.002", "at 0.006")),
}
"""Families made of some columns of another: its name, and how their labels begin."""
RIDGE = 0.5
"""Prior standard deviation of a discrepancy's coefficients. A choice: columns are scaled so that
one is a usual size, and on held-out shots a smaller one does less harm."""
SHOTS_TOGETHER = 9
"""Linearised by one process. Derived: they take 50 ms or more, ten times as long as to begin it."""
RANK_TOLERANCE = 1e-9
"""Least eigenvalue, of a matrix with ones along its diagonal, of a direction that the data see:
sums over all shots are good to 1e-12."""
SHOT_RANK_TOLERANCE = 1e-6
"""The same of one shot, whose nuisances take off what its one-sided slopes leave, good to 1e-6."""


@dataclass(frozen=True)
class LinearisedShot:
    """One shot's normal equations with its nuisances eliminated."""

    item: FitShot
    matrix: Array
    """Of s shared local parameters and what its laws may be wrong by, then q columns."""
    vector: Array
    """Minus the gradient of half the whitened squares, shape (s + q,)."""
    chain: Array
    """The first s of these by the globals, shape (s, g)."""
    residual: Array
    """Measurement less model, shape (n,). [unit of the signal]"""
    white: Array
    """The same, whitened, shape (n - p,). [1]"""

    @property
    def wide_chain(self) -> Array:
        """Return the map from globals to parameters and columns, of which none moves."""
        s, globals_ = self.chain.shape
        return np.vstack([self.chain, np.zeros((self.vector.size - s, globals_))])


@dataclass(frozen=True)
class Explained:
    """What a set of columns explains."""

    family: str
    scope: str
    """Whose a coefficient is."""
    gain: float
    """Fall of the whitened squares over all shots; chi-square where there is only noise."""
    dof: int
    """Coefficients that the data can see."""
    p_value: float
    """Of the gain, if there were only noise."""
    heldout_gain: float
    """Fall of the whitened squares of shots that the coefficients were not fitted to; negative
    where the columns do harm."""
    coefficients: dict[str, float]
    """By column label and group."""
    groups: tuple[str, ...] = ()
    """Of the coefficients, in their order; empty for the whole rig."""
    sizes: Sizes | None = None
    """Where one column has one coefficient on every material of a kind."""


@dataclass(frozen=True)
class System:
    """Normal equations of g globals and w coefficients with their groups, nuisances eliminated."""

    matrices: list[Array]
    """One a shot, shape (g + w, g + w)."""
    vectors: list[Array]
    whole: Array
    """Sum of the matrices with the globals' priors; none on coefficients."""
    load: Array
    """Sum of the vectors with these priors."""
    chains: list[Array]
    """From globals and coefficients to one shot's parameters and columns."""
    labels: list[str]
    """Of the w coefficients, with their groups."""
    groups: list[str]
    """Of the w coefficients; empty for the whole rig."""
    globals_: int


@dataclass(frozen=True)
class Linearised:
    """A campaign's linearisation around one fit, with the noise as measured."""

    problem: JointProblem
    shots: list[LinearisedShot]
    """In order of time."""
    families: Families
    scale: Scale
    precision: Array
    """Prior of the globals: shared parameters, then what the model's laws may be wrong by."""
    pull: Array
    """What that prior adds to the globals' score."""
    wrong_by: dict[str, float] = field(default_factory=dict)
    """Coefficient of each law's discrepancy at the point of the linearisation."""
    gain_of_inexactness: float = 0.0
    """Twice what ln Z rises by laws that may be wrong."""

    def groups(self, scope: str) -> list[Weights]:
        """Return for each shot the groups whose coefficients it has, with a weight."""
        return groups(self.problem, scope)

    def explain(self, family: str, scope: str = "rig", *, heldout: bool = True) -> Explained:
        """Return what one family of columns explains, and what of it holds on other shots.

        Where every shot has coefficients for itself, the globals stay put.
        """
        at, _ = self.families[family]
        if scope == "shot":
            by_shot, dof = self.of_each_shot(at, [shot.vector for shot in self.shots])
            gain = float(by_shot)
            held = gain - CRITERIA.price_of_coefficient * dof
            return Explained(family, scope, gain, dof, p_of(gain, dof), held, {})
        system = self.system([(family, scope)])
        found = Projection(system.whole, system.globals_)
        gain, dof = float(found.gain(system.load)), found.rank
        score = found.score(system.load)
        coefficients = solve_normal(found.schur + np.eye(score.size) / RIDGE**2, score)
        held = _heldout_gain(self._folds(), system) if heldout else math.nan
        named = dict(zip(system.labels, map(float, coefficients), strict=True))
        sizes = None
        if scope in KINDS and len(at) == 1:
            names = sorted({own[0][0] for own in self.groups(scope)})
            sizes = Sizes.from_score(scope, names, score, found.schur)
        p, whose = p_of(gain, dof), tuple(system.groups)
        return Explained(family, scope, gain, dof, p, held, named, whose, sizes)

    def of_each_shot(self, at: list[int], scores: Sequence[Array]) -> tuple[Array, int]:
        """Return what some columns explain with coefficients for each shot, for any scores.

        Behind it how many coefficients are seen; everything shared is kept.
        """
        gain, dof = np.asarray(0.0), 0
        for shot, score in zip(self.shots, scores, strict=True):
            inner = shot.matrix[np.ix_(at, at)]
            scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
            whitener = _whitener(inner, scale, SHOT_RANK_TOLERANCE)
            gain = gain + _squares(whitener, score[at])
            dof += whitener.shape[0]
        return gain, dof

    def system(self, parts: Sequence[tuple[str, str]]) -> System:
        """Return the normal equations of the globals and of some (family, scope)."""
        globals_ = self.pull.size
        labels: list[str] = []
        groups: list[str] = []
        chains = [shot.wide_chain for shot in self.shots]
        for family, scope in parts:
            at, own_labels = self.families[family]
            by_shot = self.groups(scope)
            names = sorted({o for shot in by_shot for o, _ in shot})
            for row, own in enumerate(by_shot):
                wider = np.zeros((chains[row].shape[0], len(names) * len(at)))
                for group, weight in own:
                    first = names.index(group) * len(at)
                    wider[at, range(first, first + len(at))] = weight
                chains[row] = np.hstack([chains[row], wider])
            labels += [f"{lab}{f' [{o}]' if o else ''}" for o in names for lab in own_labels]
            groups += [o for o in names for _ in own_labels]
        asked = {place for family, _ in parts for place in self.families[family][0]}
        matrices, vectors = [], []
        for shot, chain in zip(self.shots, chains, strict=True):
            at = sorted(asked.union(range(shot.chain.shape[0])))  # few of hundreds of columns
            wide = chain[at]
            matrices.append(wide.T @ shot.matrix[np.ix_(at, at)] @ wide)
            vectors.append(wide.T @ shot.vector[at])
        free = len(labels)
        whole = sum(matrices) + block_diag(self.precision, np.zeros((free, free)))
        load = sum(vectors) + np.append(self.pull, np.zeros(free))
        return System(matrices, vectors, whole, load, chains, labels, groups, globals_)

    def _folds(self) -> list[list[int]]:
        """Return the shots to hold out together: each height, each sphere."""
        folds = []
        for scope in ("height", "sphere"):
            keys = [own[0][0] for own in self.groups(scope)]
            if len(set(keys)) > 1:
                folds += [[i for i, k in enumerate(keys) if k == d] for d in sorted(set(keys))]
        places, count = list(range(len(self.shots))), min(3, len(self.shots))
        return folds or [places[k::count] for k in range(count)]

    @property
    def chi2(self) -> float:
        """Return the whitened squares of all samples."""
        return sum(float(s.white @ s.white) for s in self.shots)


def _whitener(matrix: Array, scale: Array, tolerance: float) -> Array:
    """Return R with R'R the inverse of a matrix in the directions that are seen. Shape (rank, w)"""
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    keep = values > tolerance
    return np.asarray((vectors[:, keep] / np.sqrt(values[keep])).T / scale)


def _squares(whitener: Array, score: Array) -> Array:
    """Return the fall of the squares, for each draw of a score of shape (w,) or (w, draws)."""
    return np.asarray(np.sum((whitener @ score) ** 2, axis=0))


def p_of(gain: float, dof: int) -> float:
    """Return the chance of such a fall of the squares in noise."""
    return float(chi2_distribution.sf(gain, dof)) if dof else 1.0


class Projection:
    """What w columns explain beyond g globals, which come first in ``whole``, for any scores."""

    def __init__(self, whole: Array, globals_: int) -> None:
        self._globals = globals_
        self._cross = whole[globals_:, :globals_]
        self._inner = whole[:globals_, :globals_]
        self.schur = whole[globals_:, globals_:] - self._cross @ solve_normal(
            self._inner, self._cross.T
        )
        scale = np.sqrt(np.maximum(np.diag(whole)[globals_:], 1e-300))
        self._white = _whitener(self.schur, scale, RANK_TOLERANCE)
        self.rank = self._white.shape[0]

    def score(self, load: Array) -> Array:
        """Return the columns' score with the globals fitted again. Shape (w,) or (w, draws)."""
        at = self._globals
        return np.asarray(load[at:] - self._cross @ solve_normal(self._inner, load[:at]))

    def gain(self, load: Array) -> Array:
        """Return the fall of the squares, for each draw."""
        return _squares(self._white, self.score(load))


def _heldout_gain(folds: list[list[int]], system: System) -> float:
    """Return the fall of held-out squares that the columns bring, averaged over ways to fold.

    A global that only the held-out shots know (the modulus of a sphere that is left out) is no
    shared parameter: it is fitted to the held-out shots, with the columns and without.
    """
    whole, globals_ = system.whole, system.globals_
    least = CRITERIA.nothing * np.diag(whole)
    total, covered = 0.0, 0
    ridge = np.zeros(whole.shape[0])
    ridge[globals_:] = RIDGE**-2
    for fold in folds:
        inside = np.sum([system.matrices[i] for i in fold], axis=0)
        own = np.sum([system.vectors[i] for i in fold], axis=0)
        rest, pull = whole - inside, system.load - own
        here, there = np.diag(inside)[:globals_], np.diag(rest)[:globals_]
        alone = np.flatnonzero((here > 0) & (there < least[:globals_]))
        x = solve_normal(rest + np.diag(ridge), pull)
        base = np.zeros_like(x)
        base[:globals_] = solve_normal(rest[:globals_, :globals_], pull[:globals_])
        falls = []
        for y in (x, base):
            y[alone] += solve_normal(inside[np.ix_(alone, alone)], (own - inside @ y)[alone])
            falls.append(float(2 * y @ own - y @ inside @ y))
        total += falls[0] - falls[1]
        covered += len(fold)
    return total * len(system.matrices) / max(covered, 1)


def linearise(
    problem: JointProblem,
    fitted: Fitted,
    tried: Sequence[Proposal] = (),
    *,
    wanted: Sequence[str] = GENERIC,
    inexact: Discrepancy | None = None,
) -> Linearised:
    """Linearise a fitted campaign, its noise as measured, with all columns to be asked about.

    Each effect of ``tried`` becomes a family under its key, beside the generic families ``wanted``.
    What the model's laws may be wrong by, ``inexact``, is further globals, at the most probable
    values of which the residual is looked at, and the family `LAW`.
    """
    scale = tuned(problem, fitted, scale_of(problem, fitted), wanted)
    forms = {one.effect.id: rescoped(one.effect, "rig") for one in tried}
    wider = {name: problem.model.with_effect(effect) for name, effect in forms.items()}

    def some(rows: range) -> list[tuple[LinearisedShot, _Way | None, Families]]:
        """Return some shots linearised."""
        return [
            _linearised_shot(
                problem, fitted, row, scale, tried=tried, wider=wider, wanted=wanted,
                inexact=inexact,
            )
            for row in rows
        ]  # fmt: skip

    rows = range(len(problem.shots))
    together = [rows[at : at + SHOTS_TOGETHER] for at in range(0, len(rows), SHOTS_TOGETHER)]
    if inexact is None:
        every = [one for part in problem.each(some, together) for one in part]
    else:  # what each shot would send is more than it saves
        every = some(rows)
    families = every[0][2]
    for name, (whole, first_words) in PARTS.items():
        if whole in families:
            own = [at for at in zip(*families[whole], strict=True) if at[1].startswith(first_words)]
            families[name] = ([place for place, _ in own], [label for _, label in own])
    precision = problem.prior_precision
    pull = -precision @ (fitted.theta - problem.prior_mean)
    shots = [shot for shot, _, _ in every]
    if inexact is None:
        return Linearised(problem, shots, families, scale, precision, pull)
    precision = block_diag(precision, inexact.precision)
    pull = np.append(pull, np.zeros(len(inexact.names)))
    exact = Linearised(problem, shots, families, scale, precision, pull)
    return _settled(exact, inexact, [way for _, way, _ in every if way is not None])


def _settled(found: Linearised, inexact: Discrepancy, ways: list[_Way]) -> Linearised:
    r"""Return the linearisation where the laws' discrepancies are at their most probable values.

    To first order, with everything else that is fitted. Twice ln Z rises by the fall of the squares
    less Occam's factor, which is of either sign:

    .. math:: \Delta C - \ln |I + \epsilon^2 \Phi^T \Phi|

    with what the other parameters take up projected out of :math:`\Phi`.
    """
    system, exact = found.system([]), len(found.problem.names)
    step = solve_normal(system.whole, system.load)
    shots = []
    for shot, (signal, white, own, back) in zip(found.shots, ways, strict=True):
        local = shot.chain @ step
        moved = np.concatenate([local, own - back @ local])
        vector = shot.vector - shot.matrix[:, : local.size] @ local
        left, left_white = shot.residual - signal @ moved, shot.white - white @ moved
        shots.append(replace(shot, vector=vector, residual=left, white=left_white))
    inner, load = system.whole[:exact, :exact], system.load
    fall = float(load @ step - load[:exact] @ solve_normal(inner, load[:exact]))
    width = 2.0 * len(inexact.names) * math.log(inexact.u)
    return replace(
        found,
        shots=shots,
        pull=found.pull - found.precision @ step,
        wrong_by=dict(zip(inexact.names, step[exact:].tolist(), strict=True)),
        gain_of_inexactness=fall - (log_det(system.whole) - log_det(inner) + width),
    )


def _stated(problem: JointProblem, item: FitShot) -> tuple[list[str], Array, Array]:
    """Return labels, columns and changes of ln v0 of all inputs, zeros of those of other shots."""
    first = len(problem.names) - len(problem.inputs)
    columns = np.zeros((item.frame.samples, len(problem.inputs)))
    faster = np.zeros(len(problem.inputs))
    for j, one in problem.inputs_of(item):
        columns[:, j - first], faster[j - first] = one.signal(item), one.faster_by(item)
    return [one.name for one in problem.inputs], columns, faster


def _linearised_shot(
    problem: JointProblem, fitted: Fitted, row: int, scale: Scale, *,
    tried: Sequence[Proposal], wider: Mapping[str, ImpactModel], wanted: Sequence[str],
    inexact: Discrepancy | None,
) -> tuple[LinearisedShot, _Way | None, Families]:  # fmt: skip
    """Return one shot, how it follows the globals, and where each family's columns are."""
    problem.checkpoint()
    model, nuisance = problem.model, fitted.nuisances[row]
    item = problem.item_at(problem.shots[row], fitted.theta)
    shared, chain = problem.shared_local(item, fitted.theta)
    local = np.concatenate([shared, nuisance])
    found, jacobian, gradient = model.linearise(local, item.frame)
    view = View(model, item, local, found.signal - nuisance[BASELINE], jacobian, scale)
    # of each family its labels, signal and change of the promised ln v0
    parts = {family: family_columns(view, family) for family in wanted}
    share, _ = problem.coupon_share(item, float(shared[0]), chain[0])
    for proposal in tried:
        models = model, wider[proposal.effect.id]
        columns, shift = column(proposal, models, local, item, found.signal, coupon_share=share)
        labels = [f"{proposal.key}.{j}" if j else proposal.key for j in range(shift.size)]
        parts[proposal.key] = (labels, columns, shift)
    if inexact is not None:
        places = inexact.places[row]
        labels = [f"{inexact.names[j].owner}.{inexact.names[j].quantity}" for j in places]
        parts = {LAW: (labels, inexact.columns[row], inexact.speeds[row])} | parts
    if problem.inputs:
        parts = {STATED: _stated(problem, item)} | parts
        chain = np.vstack([chain, np.eye(len(problem.names))[-len(problem.inputs) :]])
    if inexact is not None:
        chain = block_diag(chain, np.eye(len(inexact.names))[places])
    s = at = shared.size
    families = {}
    for family, (labels, _, _) in parts.items():
        families[family] = (list(range(at, at + len(labels))), labels)
        at += len(labels)
    # samples of a column behind one another, as whitening and products want them
    none = np.zeros((0, item.frame.samples))
    signal = np.vstack([none, *(columns.T for _, columns, _ in parts.values())]).T
    speed = np.concatenate([none[:, 0], *(shift for _, _, shift in parts.values())])
    residual = item.window.signal - found.signal
    white = item.whiten(residual)
    plain = np.vstack([jacobian[:, :s].T, signal.T, jacobian[:, s:].T]).T
    design = item.whiten(plain)
    matrix = design.T @ design
    vector = design.T @ white
    known = prior_rows(model, item, local, found.rebound_ratio, gradient)
    for value, row_of_known in zip(*known, strict=True):
        # where the promised speed moves, the shot's own does not
        wide = np.concatenate([row_of_known[:s], -row_of_known[s] * speed, row_of_known[s:]])
        matrix += np.outer(wide, wide)
        vector -= value * wide
    keep = s + signal.shape[1]
    right = np.column_stack([matrix[keep:, :keep], vector[keep:]])
    inner = solve_normal(matrix[keep:, keep:], right)
    cross = matrix[:keep, keep:]
    moving = [*range(chain.shape[0]), *range(keep, matrix.shape[0])]
    way = None
    if inexact is not None:
        way = plain[:, moving], design[:, moving], inner[:, -1], inner[:, : chain.shape[0]]
    eliminated = matrix[:keep, :keep] - cross @ inner[:, :-1]
    left = vector[:keep] - cross @ inner[:, -1]
    return LinearisedShot(item, eliminated, left, chain, residual, white), way, families
