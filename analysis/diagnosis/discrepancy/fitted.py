"""Discrepancies fitted with the model: what columns repair, judged on shots left out.

The linearisation is first order around one fit. Here the fit moves: columns and model are fitted to
each other until they agree, as one would a named effect, and the error on held-out shots is
that of the repaired prediction. Numbers that every shot has for itself are fitted to a held-out
shot as its speed and its touch-down are.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.families import Scale, scale_of, tuned
from analysis.diagnosis.candidates.refit import extended
from analysis.diagnosis.discrepancy.normal_equations import STEERED, Part, Point, form_of
from analysis.diagnosis.discrepancy.search import (
    Reached,
    TrainingShots,
    best_width,
    descend,
    reach,
    settled,
)
from analysis.diagnosis.held_out import heldout_or_none
from analysis.diagnosis.linearised import Linearised
from analysis.effects.contact_closure import contact_closure
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_folds
from analysis.fit.problem import JointProblem

Array = NDArray[np.float64]

ROUNDS, MORE_ROUNDS, FOLD_ROUNDS, TURNS = 6, 20, 3, 2
"""Steps of a search; those of `STEERED` families are short and cheap."""
WIDTHS = (0.5, 0.1, 0.02, 4e-3)
"""Sizes a coefficient may be thought of; the one that holds best on other shots is taken."""
FORCE_WIDTH = 1.0
"""A free force is thought of as at most Hertz's own."""
FORCE_STEPS = 8
"""Of a fit with a free force, which is linear in its coefficients. Chosen by trial."""


@dataclass(frozen=True)
class Learned:
    """A discrepancy and what it repairs.

    Attributes
    ----------
    parts : tuple of tuple
        (family, scope) of its columns.
    problem, fitted : JointProblem, Fitted
        The model that the columns were added to, a free force included, and where it ended.
    coefficients : dict
        Label, with its group, to coefficient.
    by_shot : dict
        Label to the coefficients that every shot has for itself, shape (shots,).
    added : list of ndarray
        What it adds to each shot. [unit of the signal]
    residual : list of ndarray
        What is left of each shot. [unit of the signal]
    chi2 : float
        Whitened squares left.
    rms, heldout_rms : float, float or None
        Pooled residual; the same on shots the discrepancy was not learned on. [unit of the signal]
    """

    parts: tuple[Part, ...]
    problem: JointProblem
    fitted: joint.Fitted
    coefficients: dict[str, float]
    by_shot: dict[str, Array]
    added: list[Array]
    residual: list[Array]
    chi2: float
    rms: float
    heldout_rms: float | None

    @property
    def family(self) -> str:
        """Return the families, joined."""
        return "+".join(f for f, _ in self.parts)

    @property
    def scope(self) -> str:
        """Return the groups, joined."""
        return "+".join(s for _, s in self.parts)


def learn(
    problem: JointProblem, fitted: joint.Fitted, parts: Sequence[Part], scale: Scale | None = None
) -> Learned | None:
    """Fit a discrepancy and the present model to each other.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        The present model at its best.
    parts : sequence of tuple
        (family, scope) of the columns.
    scale : Scale, optional
        Sizes of the columns, with the frequencies of tuned families.

    Returns
    -------
    Learned or None
        The best that was reached; None where no step made it better.
    """
    sizes = tuned(problem, fitted, scale or scale_of(problem, fitted), [f for f, _ in parts])
    form = form_of(problem, fitted.theta, fitted.nuisances, tuple(parts), sizes)
    count = len(problem.shots)
    begin = Point(
        fitted.theta, fitted.nuisances, np.zeros(form.shared), np.zeros((count, form.own))
    )
    training = TrainingShots(problem, form, list(range(count)), WIDTHS[0])
    start = reach(training, begin)
    if start is None:
        return None
    folds = heldout_folds(problem)
    if folds and form.shared:
        width, _ = best_width(training, start, folds, WIDTHS)
        training = TrainingShots(problem, form, training.places, width)
    rounds = MORE_ROUNDS if any(f in STEERED for f, _ in parts) else ROUNDS
    end = start
    for _ in range(TURNS if form.own else 1):
        if form.own:  # these may be anywhere: shot by shot first, each as it fares best
            end = settled(training, end.point) or end
        end = descend(training, end, rounds)
    if not end.cost < start.cost:
        return None
    moved = joint.Fitted(
        end.point.theta, end.point.nuisances, fitted.blocks, fitted.covariance, end.cost, 0, True
    )
    residual = [b.residual for b in end.blocks]
    return Learned(
        tuple(parts),
        problem,
        moved,
        dict(zip(form.labels, map(float, end.point.shared), strict=True)),
        dict(zip(form.own_labels, end.point.own.T, strict=True)),
        [b.added for b in end.blocks],
        residual,
        sum(b.chi2 for b in end.blocks),
        _rms(residual),
        _heldout(training, start, end, folds),
    )


def _rms(residual: Sequence[Array]) -> float:
    return math.sqrt(sum(float(r @ r) for r in residual) / sum(r.size for r in residual))


def _heldout(
    training: TrainingShots, start: Reached, end: Reached, folds: Sequence[Sequence[int]]
) -> float | None:
    """Return the residual of shots that neither globals nor shared coefficients were fitted to."""
    if not folds:
        return None
    squares, count = 0.0, 0
    for fold in folds:
        kept = [i for i in range(len(end.blocks)) if i not in fold]
        others = training.part(kept)
        begin = reach(others, _rows(end.point, kept))
        if begin is None:
            return None
        learned = descend(others, begin, FOLD_ROUNDS)
        if learned is begin and training.form.shared:
            # what the held-out shots had a say in would still stand: once more, from before
            begin = reach(others, _rows(start.point, kept))
            if begin is None:
                return None
            learned = descend(others, begin, ROUNDS)
            if learned is begin:
                return None
        known = Point(
            learned.point.theta,
            end.point.nuisances[list(fold)],
            learned.point.shared,
            end.point.own[list(fold)],
        )
        found = settled(training.part(fold), known)
        if found is None:
            return None
        squares += sum(float(b.residual @ b.residual) for b in found.blocks)
        count += sum(b.residual.size for b in found.blocks)
    return math.sqrt(squares / count)


def _rows(point: Point, rows: Sequence[int]) -> Point:
    at = list(rows)
    return Point(point.theta, point.nuisances[at], point.shared, point.own[at])


def learn_force(
    problem: JointProblem,
    fitted: joint.Fitted,
    linearised: Linearised,
    *,
    forms: Sequence[str],
    scope: str,
) -> Learned | None:
    """Fit a contact force of free form, integrated as any contact law is.

    Parameters
    ----------
    problem, fitted, linearised : JointProblem, Fitted, Linearised
        The present model at its best.
    forms : sequence of str
        Of ``analysis.effects.contact_closure.FORMS``.
    scope : str
        Who owns the numbers: rig, surface or sphere.

    Returns
    -------
    Learned or None
        None where the force could not be fitted.
    """
    scale = scale_of(problem, fitted)
    wide, found = problem, fitted
    for form in forms:
        effect = contact_closure(form, scale.indentation_m, scale.speed_m_per_s, scope)
        wide, theta, nuisances = extended(wide, found, effect, {})
        size = len(theta) - found.theta.size
        for j in range(theta.size - size, theta.size):
            wide.prior_precision[j, j] = FORCE_WIDTH**-2
        ahead = joint.fit(wide, nuisances, theta=theta, max_iterations=FORCE_STEPS)
        if not ahead.blocks:
            return None
        found = ahead
    residual = _residual(wide, found)
    first = len(problem.names)
    coefficients = {
        name.removeprefix("closure_"): float(value)
        for name, value in zip(wide.names[first:], found.theta[first:], strict=True)
    }
    return Learned(
        tuple((f"force_{form}", scope) for form in forms),
        wide,
        found,
        coefficients,
        {},
        [old.residual - r for old, r in zip(linearised.shots, residual, strict=True)],
        residual,
        sum(b.chi2 for b in found.blocks),
        _rms(residual),
        heldout_or_none(wide, found),
    )


def on_top(first: Learned, second: Learned) -> Learned:
    """Return a discrepancy that was learned on top of a free force as one with it.

    Parameters
    ----------
    first : Learned
        The force, from `learn_force`.
    second : Learned
        Learned with the force's ``problem`` and ``fitted``.

    Returns
    -------
    Learned
        With the parts and coefficients of both.
    """
    before = [a + r for a, r in zip(first.added, first.residual, strict=True)]
    return dataclasses.replace(
        second,
        parts=(*first.parts, *second.parts),
        coefficients=first.coefficients | second.coefficients,
        added=[b - r for b, r in zip(before, second.residual, strict=True)],
    )


def _residual(problem: JointProblem, fitted: joint.Fitted) -> list[Array]:
    found = []
    for item, nuisance in zip(problem.shots, fitted.nuisances, strict=True):
        shared, _ = problem.shared_local(item, fitted.theta)
        seen = problem.model.predict(np.concatenate([shared, nuisance]), item.frame)
        found.append(item.window.signal - seen.signal)
    return found
