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
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.stats import chi2 as chi2_distribution

from analysis.diagnosis.basis.families import View, family_columns
from analysis.diagnosis.basis.form_error import Discrepancy
from analysis.diagnosis.basis.groups import groups
from analysis.diagnosis.basis.proposals import Proposal, column
from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.some_materials import Sizes
from analysis.diagnosis.basis.tuning import scale_of, tuned
from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.acts_on import KINDS
from analysis.fit.blocks import prior_rows
from analysis.fit.joint import Fitted
from analysis.fit.problem import FitShot, JointProblem

Array = NDArray[np.float64]
Part = tuple[str, list[str], Array, Array | None, Array | None]
"""A family with its labels, signal, and changes of the rebound and of the promised ln v0."""

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
LAW = "law"
"""The family of what the model's own laws may be wrong by, where that is taken into account."""
RIDGE = 0.5
"""A discrepancy's coefficients are of order one where it changes the signal by its own size."""
RANK_TOLERANCE = 1e-9
"""Least eigenvalue, of a matrix with ones along its diagonal, of a direction that the data see:
sums over all shots are good to 1e-12."""
SHOT_RANK_TOLERANCE = 1e-6
"""The same of one shot, whose nuisances take off what its one-sided slopes leave, good to 1e-6."""


@dataclass(frozen=True)
class LinearisedShot:
    """One shot's normal equations with its nuisances eliminated.

    Attributes
    ----------
    item : FitShot
        The shot.
    matrix : ndarray, shape (s + q, s + q)
        Shared local parameters and what its laws may be wrong by, then columns.
    vector : ndarray, shape (s + q,)
        Minus the gradient of half the whitened squares.
    chain : ndarray, shape (s, g)
        The first s of these by the globals.
    residual : ndarray, shape (n,)
        Measurement less model. [unit of the signal]
    white : ndarray, shape (n - p,)
        The same, whitened. [1]
    touch_down : float
        Sample of the window at which the contact begins.
    """

    item: FitShot
    matrix: Array
    vector: Array
    chain: Array
    residual: Array
    white: Array
    touch_down: float


@dataclass(frozen=True)
class Explained:
    """What a set of columns explains.

    Attributes
    ----------
    family, scope : str
        Which columns, and who owns a coefficient.
    gain : float
        Fall of the whitened squares over all shots.
    dof : int
        Coefficients the data can see.
    p_value : float
        Of the gain, if there were only noise.
    heldout_gain : float
        Fall of the whitened squares of shots that the coefficients were not fitted to; negative
        where the columns do harm.
    coefficients : dict
        Column label and group to coefficient.
    sizes : Sizes or None
        Where one column has one coefficient on every material of a kind.
    """

    family: str
    scope: str
    gain: float
    dof: int
    p_value: float
    heldout_gain: float
    coefficients: dict[str, float]
    sizes: Sizes | None = None


@dataclass(frozen=True)
class System:
    """Normal equations of globals and of coefficients with their groups, nuisances eliminated.

    Attributes
    ----------
    matrices, vectors : list of ndarray, shapes (g + w, g + w), (g + w,)
        One a shot.
    whole, load : ndarray
        Their sums with the globals' priors.
    chains : list of ndarray, shape (s + q, g + w)
        From globals and coefficients to one shot's parameters and columns.
    labels : list of str
        Of the w coefficients, with their groups.
    globals_ : int
        How many globals come first.
    """

    matrices: list[Array]
    vectors: list[Array]
    whole: Array
    load: Array
    chains: list[Array]
    labels: list[str]
    globals_: int


@dataclass(frozen=True)
class Linearised:
    """A campaign's linearisation around one fit.

    Attributes
    ----------
    problem : JointProblem
        What was fitted.
    fitted : Fitted
        Its solution with the noise as measured.
    shots : list of LinearisedShot
        In order of time.
    families : dict
        Positions of each family's columns, and their labels.
    scale : Scale
        Sizes that the columns are measured in.
    precision : ndarray, shape (g, g)
        Prior of the globals: shared parameters, then what the model's laws may be wrong by.
    pull : ndarray, shape (g,)
        What that prior adds to the globals' score.
    wrong_by : dict
        Coefficient of each law's discrepancy at the point of the linearisation.
    gain_of_inexactness : float
        Twice what ln Z gains by laws that may be wrong. [1]
    """

    problem: JointProblem
    fitted: Fitted
    shots: list[LinearisedShot]
    families: dict[str, tuple[list[int], list[str]]]
    scale: Scale
    precision: Array
    pull: Array
    wrong_by: dict[str, float] = field(default_factory=dict)
    gain_of_inexactness: float = 0.0

    # -- groups ----------------------------------------------------------------------------------
    def groups(self, scope: str) -> list[list[tuple[str, float]]]:
        """Return for each shot who owns its coefficients, with a weight.

        Parameters
        ----------
        scope : str
            As `analysis.diagnosis.basis.groups.groups` knows it.

        Returns
        -------
        list of list of tuple
            (group, weight) for each shot.
        """
        return groups(self.problem, scope)

    def explain(self, family: str, scope: str = "rig", *, heldout: bool = True) -> Explained:
        """Return what one family of columns explains, and what of it holds on other shots.

        Parameters
        ----------
        family : str
            A key of ``families``.
        scope : str
            Who owns a coefficient.
        heldout : bool
            Also compute the gain on held-out shots.

        Returns
        -------
        Explained
            First-order gains; chi-square distributed without structure.
        """
        at, labels = self.families[family]
        if scope == "shot":
            return self._solve_by_shot(at, family)
        return self._solve(at, labels, family, scope, heldout=heldout)

    def _solve_by_shot(self, at: list[int], family: str) -> Explained:
        """Return the gain of coefficients that every shot has for itself; globals stay put."""
        gain, dof = 0.0, 0
        for shot in self.shots:
            own = ShotProjection(shot, at)
            gain += float(own.gain(shot.vector[at]))
            dof += own.rank
        p = float(chi2_distribution.sf(gain, dof)) if dof else 1.0
        held = gain - CRITERIA.discrepancy.price_of_coefficient * dof
        return Explained(family, "shot", gain, dof, p, held, {})

    def _solve(
        self, at: list[int], labels: list[str], family: str, scope: str, *, heldout: bool
    ) -> Explained:
        system = self.system([(family, scope)])
        found = Projection(system.whole, system.globals_)
        gain, dof = float(found.gain(system.load)), found.rank
        score = found.score(system.load)
        coefficients = _solved(found.schur + np.eye(score.size) / RIDGE**2, score)
        held = _heldout_gain(self._folds(), system) if heldout else math.nan
        p = float(chi2_distribution.sf(gain, dof)) if dof else 1.0
        named = dict(zip(system.labels, map(float, coefficients), strict=True))
        sizes = None
        if scope in KINDS and len(at) == 1:
            names = sorted({own[0][0] for own in self.groups(scope)})
            sizes = Sizes.from_score(scope, names, score, found.schur)
        return Explained(family, scope, gain, dof, p, held, named, sizes)

    def system(self, parts: Sequence[tuple[str, str]]) -> System:
        """Return the normal equations of the globals and of families with their groups.

        Parameters
        ----------
        parts : sequence of tuple
            (family, scope) each.

        Returns
        -------
        System
            Priors of the globals included; none on coefficients.
        """
        globals_ = self.pull.size
        labels: list[str] = []
        chains = [_wide(shot, globals_) for shot in self.shots]
        for family, scope in parts:
            at, own_labels = self.families[family]
            groups = self.groups(scope)
            names = sorted({o for shot in groups for o, _ in shot})
            for row, own in enumerate(groups):
                wider = np.zeros((chains[row].shape[0], len(names) * len(at)))
                for group, weight in own:
                    first = names.index(group) * len(at)
                    wider[at, range(first, first + len(at))] = weight
                chains[row] = np.hstack([chains[row], wider])
            labels += [f"{lab}{f' [{o}]' if o else ''}" for o in names for lab in own_labels]
        matrices = [c.T @ s.matrix @ c for c, s in zip(chains, self.shots, strict=True)]
        vectors = [c.T @ s.vector for c, s in zip(chains, self.shots, strict=True)]
        size = globals_ + len(labels)
        prior = np.zeros((size, size))
        prior[:globals_, :globals_] = self.precision
        pull = np.zeros(size)
        pull[:globals_] = self.pull
        return System(
            matrices, vectors, sum(matrices) + prior, sum(vectors) + pull, chains, labels, globals_
        )

    def _folds(self) -> list[list[int]]:
        """Return the shots to hold out together: each height, each sphere."""
        folds = []
        for scope in ("height", "sphere"):
            keys = [own[0][0] for own in self.groups(scope)]
            distinct = sorted(set(keys))
            if len(distinct) > 1:
                folds += [[i for i, k in enumerate(keys) if k == d] for d in distinct]
        if not folds:
            count = min(3, len(self.shots))
            folds = [list(range(k, len(self.shots), count)) for k in range(count)]
        return folds

    @property
    def chi2(self) -> float:
        """Return the whitened squares of all samples."""
        return sum(float(s.white @ s.white) for s in self.shots)


def _wide(shot: LinearisedShot, globals_: int) -> Array:
    """Return the map from globals to a shot's parameters and columns, none of the columns moved."""
    chain = np.zeros((shot.vector.size, globals_))
    chain[: shot.chain.shape[0]] = shot.chain
    return chain


def _solved(matrix: Array, right: Array) -> Array:
    """Return a solution, the shortest where there are many.

    A fit that has gone astray has columns of 1e20, beside which no ridge is left.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, right), dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0], dtype=np.float64)


class Projection:
    """What columns explain beyond the globals, for any scores.

    Parameters
    ----------
    whole : ndarray, shape (g + w, g + w)
        Normal matrix of globals, then of the columns' coefficients.
    globals_ : int
        How many globals come first.
    """

    def __init__(self, whole: Array, globals_: int) -> None:
        self._globals = globals_
        self._cross = whole[globals_:, :globals_]
        self._inner = whole[:globals_, :globals_]
        back = _solved(self._inner, self._cross.T)
        self.schur = whole[globals_:, globals_:] - self._cross @ back
        raw = np.sqrt(np.maximum(np.diag(whole)[globals_:], 1e-300))
        values, vectors = np.linalg.eigh(self.schur / np.outer(raw, raw))
        keep = values > RANK_TOLERANCE
        self.rank = int(keep.sum())
        self._white = (vectors[:, keep] / np.sqrt(values[keep])).T / raw

    def score(self, load: Array) -> Array:
        """Return the columns' score with the globals fitted again. Shape (w,) or (w, draws)."""
        at = self._globals
        return np.asarray(load[at:] - self._cross @ _solved(self._inner, load[:at]))

    def gain(self, load: Array) -> Array:
        """Return the fall of the squares, for each draw."""
        return np.asarray(np.sum((self._white @ self.score(load)) ** 2, axis=0))


class ShotProjection:
    """What a shot's own coefficients explain, everything shared kept, for any scores.

    Parameters
    ----------
    shot : LinearisedShot
        The shot.
    at : list of int
        Its columns.
    """

    def __init__(self, shot: LinearisedShot, at: list[int]) -> None:
        inner = shot.matrix[np.ix_(at, at)]
        scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
        values, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
        keep = values > SHOT_RANK_TOLERANCE
        self.rank = int(keep.sum())
        self._white = (vectors[:, keep] / np.sqrt(values[keep])).T / scale

    def gain(self, score: Array) -> Array:
        """Return the fall of the squares, for each draw."""
        return np.asarray(np.sum((self._white @ score) ** 2, axis=0))


def _heldout_gain(folds: list[list[int]], system: System) -> float:
    """Return the fall of held-out squares that the columns bring, averaged over ways to fold.

    A global that only the held-out shots know (the modulus of a sphere that is left out) is no
    shared parameter: it is fitted to the held-out shots, with the columns and without.
    """
    matrices, vectors, globals_ = system.matrices, system.vectors, system.globals_
    whole, load = system.whole, system.load
    total, covered = 0.0, 0
    size = whole.shape[0]
    ridge = np.zeros(size)
    ridge[globals_:] = RIDGE**-2
    for fold in folds:
        inside = np.sum([matrices[i] for i in fold], axis=0)
        own = np.sum([vectors[i] for i in fold], axis=0)
        covered += len(fold)
        rest, pull = whole - inside, load - own
        alone = [
            j
            for j in range(globals_)
            if inside[j, j] > 0 and rest[j, j] < CRITERIA.discrepancy.fold_own_weight * whole[j, j]
        ]
        x = _solved(rest + np.diag(ridge), pull)
        base = np.zeros(size)
        base[:globals_] = _solved(rest[:globals_, :globals_], pull[:globals_])
        fall = [_fall(v, inside, own, alone) for v in (x, base)]
        total += fall[0] - fall[1]
    return total * len(matrices) / max(covered, 1)


def _fall(x: Array, inside: Array, own: Array, alone: list[int]) -> float:
    """Return the fall of held-out squares at x, the fold's own globals set to their best."""
    x = x.copy()
    if alone:
        gradient = own - inside @ x
        x[alone] += _solved(inside[np.ix_(alone, alone)], gradient[alone])
    return float(2 * x @ own - x @ inside @ x)


def linearise(
    problem: JointProblem,
    fitted: Fitted,
    tried: Sequence[Proposal] = (),
    *,
    wanted: Sequence[str] = GENERIC,
    inexact: Discrepancy | None = None,
) -> Linearised:
    """Linearise a fitted campaign with all generic columns and those of named effects.

    Parameters
    ----------
    problem : JointProblem
        With the noise as measured, not widened.
    fitted : Fitted
        Its solution.
    tried : sequence of Proposal
        Effects to look along; each becomes a family under its key.
    wanted : sequence of str
        Generic families.
    inexact : Discrepancy, optional
        What the model's laws may be wrong by: further globals, at the most probable values of
        which the residual is looked at, and the family `LAW`.

    Returns
    -------
    Linearised
        Ready to be asked.
    """
    scale = tuned(problem, fitted, scale_of(problem, fitted), wanted)
    families: dict[str, tuple[list[int], list[str]]] = {}
    shots = []
    for row, (item, nuisance) in enumerate(zip(problem.shots, fitted.nuisances, strict=True)):
        shots.append(
            _linearised_shot(
                problem,
                fitted.theta,
                item,
                nuisance=nuisance,
                scale=scale,
                families=families,
                tried=tried,
                wanted=wanted,
                laws=None if inexact is None else (inexact, row),
            )
        )
    pull = -problem.prior_precision @ (fitted.theta - problem.prior_mean)
    precision = problem.prior_precision
    if inexact is not None:
        precision = block_diag(precision, inexact.precision)
        pull = np.concatenate([pull, np.zeros(len(inexact.names))])
    plain = [shot for shot, _ in shots]
    families |= _parts_of(families)
    found = Linearised(problem, fitted, plain, families, scale, precision, pull)
    return found if inexact is None else _settled(found, inexact, [way for _, way in shots])


def _settled(found: Linearised, inexact: Discrepancy, ways: list[_Way]) -> Linearised:
    """Return the linearisation where the laws' discrepancies are at their most probable values.

    To first order, with everything else that is fitted.
    """
    system = found.system([])
    step = _solved(system.whole, system.load)
    shots = []
    for shot, way in zip(found.shots, ways, strict=True):
        local = shot.chain @ step
        moved = np.concatenate([local, way.own - way.back @ local])
        shots.append(
            replace(
                shot,
                vector=shot.vector - shot.matrix[:, : local.size] @ local,
                residual=shot.residual - way.signal @ moved,
                white=shot.white - way.white @ moved,
            )
        )
    coefficients = step[len(found.problem.names) :].tolist()
    wrong_by = dict(zip(inexact.names, coefficients, strict=True))
    pull = found.pull - found.precision @ step
    gain = _gain_of_inexactness(system, step, len(found.problem.names), inexact)
    return replace(found, shots=shots, pull=pull, wrong_by=wrong_by, gain_of_inexactness=gain)


def _gain_of_inexactness(system: System, step: Array, exact: int, inexact: Discrepancy) -> float:
    r"""Return twice what ln Z gains where the laws may be wrong: squares less Occam's factor.

    .. math:: \Delta C - \ln |I + \epsilon^2 \Phi^T \Phi|

    with what the other parameters take up projected out of :math:`\Phi`. It is of either sign.
    """
    inner, load = system.whole[:exact, :exact], system.load
    fall = float(load @ step - load[:exact] @ _solved(inner, load[:exact]))
    width = 2.0 * len(inexact.names) * math.log(inexact.u)
    return fall - (_log_det(system.whole) - _log_det(inner) + width)


def _log_det(matrix: Array) -> float:
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    return float(np.linalg.slogdet(matrix / np.outer(scale, scale))[1] + 2.0 * np.log(scale).sum())


def _parts_of(
    families: dict[str, tuple[list[int], list[str]]],
) -> dict[str, tuple[list[int], list[str]]]:
    """Return families that are parts of others: a chain's ring, decay and delay; a bend, a top."""
    found = {}
    for name, (whole, first_words) in PARTS.items():
        if whole in families:
            at, labels = families[whole]
            own = [j for j, label in enumerate(labels) if label.startswith(first_words)]
            found[name] = ([at[j] for j in own], [labels[j] for j in own])
    return found


@dataclass(frozen=True)
class _Way:
    """How one shot follows the globals, its own parameters with them.

    Attributes
    ----------
    signal, white : ndarray, shape (n, s + p), (n - h, s + p)
        Derivatives by shared and own parameters; the same whitened.
    own : ndarray, shape (p,)
        Step of the shot's own parameters if nothing else moves.
    back : ndarray, shape (p, s)
        What that loses with a step of the shared ones.
    """

    signal: Array
    white: Array
    own: Array
    back: Array


def _linearised_shot(
    problem: JointProblem,
    theta: Array,
    item: FitShot,
    *,
    nuisance: Array,
    scale: Scale,
    families: dict[str, tuple[list[int], list[str]]],
    tried: Sequence[Proposal],
    wanted: Sequence[str],
    laws: tuple[Discrepancy, int] | None,
) -> tuple[LinearisedShot, _Way]:
    problem.checkpoint()
    model = problem.model
    shared, chain = problem.shared_local(item, theta)
    local = np.concatenate([shared, nuisance])
    found, jacobian, gradient = model.linearise(local, item.frame)
    clean = found.signal - local[len(model.shared) + 3]
    view = View(model, item, local, clean, jacobian, scale)
    parts = [(f, *family_columns(view, f)) for f in wanted]
    share, _ = problem.coupon_share(item, float(shared[0]), chain[0])
    for proposal in tried:
        columns, shift = column(proposal, model, local, item, found.signal, coupon_share=share)
        labels = [f"{proposal.key}.{j}" if j else proposal.key for j in range(shift.size)]
        parts.append((proposal.key, labels, columns, None, shift))
    s = at = len(model.shared)
    if laws is not None:
        law, chain = _law(*laws, chain)
        parts.insert(0, law)
    for family, labels, _, _, _ in parts:
        families[family] = (list(range(at, at + len(labels))), labels)
        at += len(labels)
    signal = np.column_stack([p[2] for p in parts])
    q = signal.shape[1]
    speed = np.concatenate([p[4] if p[4] is not None else np.zeros(len(p[1])) for p in parts])
    residual = item.window.signal - found.signal
    white = item.whiten(residual)
    plain = np.column_stack([jacobian[:, :s], signal, jacobian[:, s:]])
    design = item.whiten(plain)
    extra, rows = prior_rows(model, item, local, found.rebound_ratio, gradient)
    wide = []
    for row in rows:
        # where the promised speed moves, the shot's own does not
        between = -row[s] * speed
        wide.append(np.concatenate([row[:s], between, row[s:]]))
    matrix = design.T @ design
    vector = design.T @ white
    for value, row in zip(extra, wide, strict=True):
        matrix += np.outer(row, row)
        vector -= value * row
    keep = s + q
    inner: Array = np.asarray(
        np.linalg.solve(
            matrix[keep:, keep:], np.column_stack([matrix[keep:, :keep], vector[keep:]])
        ),
        dtype=np.float64,
    )
    cross = matrix[:keep, keep:]
    moving = [*range(chain.shape[0]), *range(keep, matrix.shape[0])]
    way = _Way(plain[:, moving], design[:, moving], inner[:, -1], inner[:, : chain.shape[0]])
    touch_down = float(nuisance[2]) * 1e-6 * item.frame.sample_rate_hz
    eliminated = matrix[:keep, :keep] - cross @ inner[:, :-1]
    left = vector[:keep] - cross @ inner[:, -1]
    return LinearisedShot(item, eliminated, left, chain, residual, white, touch_down), way


def _law(inexact: Discrepancy, row: int, chain: Array) -> tuple[Part, Array]:
    """Return a shot's columns of what its laws may be wrong by, and the chain to them."""
    at, count = inexact.places[row], len(inexact.names)
    wide = np.zeros((chain.shape[0] + at.size, chain.shape[1] + count))
    wide[: chain.shape[0], : chain.shape[1]] = chain
    wide[range(chain.shape[0], wide.shape[0]), chain.shape[1] + at] = 1.0
    labels = [inexact.names[j].partition(" [")[0] for j in at]
    return (LAW, labels, inexact.columns[row], None, inexact.speeds[row]), wide
