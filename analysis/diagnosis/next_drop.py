r"""The drop that would tell two fitted models apart best.

Of a drop not yet made, each rival predicts a record. What of their difference d the other rival
could not take up again, by the shot's own speed, loss, touch-down and baseline and by what the
campaign leaves open in its globals, is what n such drops add to the difference of their costs:

.. math:: D_n^2 = n q - n^2 v^T (P + n H)^{-1} v

with q, v and H the square of d, its projection on the globals' columns and those columns' squares,
all whitened and with the nuisances eliminated, and P the globals' information so far. To first
order; noise scatters the sum of whitened squares by about 2 D.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.candidate import Refit
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.possible_drops import PossibleDrop, as_shot, possible_drops
from analysis.fit import joint
from analysis.fit.blocks import prior_rows
from analysis.fit.problem import FitShot, JointProblem
from analysis.model.impact_model import NUISANCE, SHARED

Array = NDArray[np.float64]
Json = dict[str, Any]

MOST_REPEATS = 20
"""Of one drop: who would make more?"""
LARGEST_CODE = 32767
"""Of a converter of 16 bits."""


@dataclass(frozen=True)
class NextDrop:
    """A drop worth making.

    Attributes
    ----------
    sphere, surface : str
        The pair.
    drop_height_m : float
        [m]
    separates : tuple of str
        Ids of the two effects.
    expected_distance : float
        How far one such drop moves the two apart, as the root of whitened squares. [1]
    repeats : int
        Drops after which the distance reaches ``CRITERIA.next_drop.distance``.
    """

    sphere: str
    surface: str
    drop_height_m: float
    separates: tuple[str, str]
    expected_distance: float
    repeats: int

    def to_json(self) -> Json:
        """Return it as the ``next_drop`` of a diagnosis."""
        return {**dataclasses.asdict(self), "separates": list(self.separates)}


@dataclass(frozen=True)
class _Side:
    """One rival, and what the campaign has told of its globals."""

    rival: Refit
    information: Array

    @property
    def problem(self) -> JointProblem:
        return self.rival.problem


@dataclass(frozen=True)
class _Prediction:
    """What one rival says of a drop: its record, and how it would give way."""

    signal: Array
    white: Array
    columns: Array
    rows: Array
    chain: Array


def propose(
    rivals: Sequence[Refit], *, heights_m: Sequence[float] | None = None
) -> NextDrop | None:
    """Return the drop that would separate the first rival from the next best one best.

    Parameters
    ----------
    rivals : sequence of Refit
        Fitted to the same shots, best first.
    heights_m : sequence of float, optional
        Heights the rig can do [m]; by default a range about those tried.

    Returns
    -------
    NextDrop or None
        None where the rig is in reduced units, where heights are not known, or where
        `MOST_REPEATS` of no drop would be enough.

    Notes
    -----
    Only drops whose record stays within the converter's range, or else within the largest record
    so far, are considered. Validation: the costs of two rivals after the drop was simulated and
    both were fitted again, in ``tests/analysis/diagnosis/test_next_drop.py``.
    """
    sides = [_side(r) for r in rivals if r.fitted.blocks]
    if not sides:
        return None
    drops = list(possible_drops(sides[0].problem, heights_m))
    for other in sides[1:]:
        found = _best(sides[0], other, drops)
        if found is not None:
            return found
    return None


def _side(rival: Refit) -> _Side:
    return _Side(rival, joint.normal_equations(rival.problem, rival.fitted)[0])


def _best(one: _Side, other: _Side, drops: Sequence[PossibleDrop]) -> NextDrop | None:
    best: tuple[float, int, PossibleDrop] | None = None
    for drop in drops:
        one.problem.checkpoint()
        found = _separation(one, other, drop)
        if found is not None and (best is None or found[0] > best[0]):
            best = (*found, drop)
    if best is None:
        return None
    distance, repeats, drop = best
    ids = (one.rival.effect_id, other.rival.effect_id)
    return NextDrop(drop.sphere, drop.surface, drop.height_m, ids, distance, repeats)


def _loss(side: _Side, drop: PossibleDrop) -> float:
    """Return ln e as a rival's shots of the pair have it, else as those of either material do.

    Rivals share a sphere's loss between dashpot and effect differently, and often with the speed.
    """
    shots = side.problem.shots
    at = NUISANCE.index("ln_e")
    same = [(s.shot.sphere == drop.sphere) + (s.shot.surface == drop.surface) for s in shots]
    rows = [i for i, n in enumerate(same) if n == max(same)]
    return float(np.median(side.rival.fitted.nuisances[rows, at]))


def _predict(side: _Side, drop: PossibleDrop) -> _Prediction | None:
    """Return what a rival says of a drop, None where it says nothing."""
    problem, fitted = side.problem, side.rival.fitted
    item, model = as_shot(problem, drop), problem.model
    rows = range(len(SHARED[model.kind]), len(model.shared))
    keys = [problem.effect_key(row, item) for row in rows]
    if any(key is not None and key not in problem.names for key in keys):
        return None
    shared, chain = problem.shared_local(item, fitted.theta)
    assert item.speed_prior is not None
    local = np.concatenate([shared, fitted.nuisances[drop.template]])
    at = len(model.shared)
    local[at : at + 2] = item.speed_prior.mean, _loss(side, drop)
    local[at] += model.speed_shift(local, item.frame)
    found, jacobian, gradient = model.linearise(local, item.frame)
    if not (math.isfinite(found.rebound_ratio) and np.isfinite(jacobian).all()):
        return None
    _, known = prior_rows(model, item, local, found.rebound_ratio, gradient)
    return _Prediction(
        found.signal,
        item.whiten(found.signal),
        item.whiten(jacobian),
        np.array(known),
        chain,
    )


def _separation(one: _Side, other: _Side, drop: PossibleDrop) -> tuple[float, int] | None:
    """Return how far a drop separates two rivals, whichever is right, and how often to repeat it.

    None where it would clip, where a rival says nothing of it, or where no number of repeats is
    enough.
    """
    predictions = _predict(one, drop), _predict(other, drop)
    first, second = predictions
    if first is None or second is None:
        return None
    top = max(float(np.abs(p.signal).max()) for p in (first, second))
    if top > _largest_signal(one.problem.shots):
        return None
    difference = first.white - second.white
    yielding = [(first, one), (second, other)]
    try:
        parts = [_parts(p, side.information, difference) for p, side in yielding]
        for repeats in range(1, MOST_REPEATS + 1):
            if all(_squared(p, repeats) >= CRITERIA.next_drop.distance**2 for p in parts):
                return math.sqrt(max(min(_squared(p, 1) for p in parts), 0.0)), repeats
    except np.linalg.LinAlgError:  # a number that nothing fixes: such a fit foretells nothing
        return None
    return None


def _largest_signal(shots: Sequence[FitShot]) -> float:
    """Return up to where a record is certainly whole. [unit of the signal]"""
    clipped = [s.window.peak for s in shots if s.shot.clipped]
    steps = [s.shot.quantum for s in shots if s.shot.quantum is not None]
    if clipped:
        return CRITERIA.next_drop.signal_share * min(clipped)
    if len(steps) == len(shots):
        return CRITERIA.next_drop.signal_share * LARGEST_CODE * min(steps)
    return max(s.window.peak for s in shots)


_Parts = tuple[float, Array, Array, Array]


def _parts(rival: _Prediction, information: Array, difference: Array) -> _Parts:
    """Return q, v, H and P of one rival that gives way to a difference."""
    s = rival.chain.shape[0]
    matrix = rival.columns.T @ rival.columns + rival.rows.T @ rival.rows
    vector = rival.columns.T @ difference
    back = np.linalg.solve(matrix[s:, s:], np.column_stack([matrix[s:, :s], vector[s:]]))
    cross = matrix[:s, s:]
    inner = rival.chain.T @ (matrix[:s, :s] - cross @ back[:, :-1]) @ rival.chain
    load = rival.chain.T @ (vector[:s] - cross @ back[:, -1])
    rest = float(difference @ difference - vector[s:] @ back[:, -1])
    return rest, load, inner, information


def _squared(parts: _Parts, repeats: int) -> float:
    """Return the squared distance after some repeats."""
    rest, load, inner, information = parts
    taken = np.linalg.solve(information + repeats * inner, load)
    return float(repeats * rest - repeats**2 * load @ taken)
