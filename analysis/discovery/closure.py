"""Closures learned for real: what generic columns repair, judged on shots they were not learned on.

The evidence is first order around one fit. Here the fit moves: columns and model are fitted to
each other in turn until they agree, as one would a named effect, and the error on held-out shots is
that of the repaired prediction.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.candidates import extended
from analysis.discovery.evidence import PARTS, Evidence, System, gather, scale_of
from analysis.discovery.quality import heldout_or_none
from analysis.effects.contact_closure import contact_closure
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_folds
from analysis.fit.problem import FitShot, JointProblem

Array = NDArray[np.float64]
Part = tuple[str, str]

ROUNDS = 7
WIDTHS = (0.5, 0.1, 0.02, 4e-3)
"""Sizes a coefficient may be thought of; the one that holds best on other shots is taken."""
FORCE_WIDTH = 1.0
"""A free force is thought of as at most Hertz's own."""
FOLD_ROUNDS = 2
FIT_STEPS = 8
AGREED = 1e-3
"""Relative fall of the whitened squares at which columns and model agree."""


@dataclass(frozen=True)
class Learned:
    """A closure and what it repairs.

    Attributes
    ----------
    parts : tuple of tuple
        (family, scope) of its columns.
    problem, fitted : JointProblem, Fitted
        The base model fitted to the records less what the closure adds.
    evidence : Evidence
        Around that fit, with the closure's columns.
    coefficients : dict
        Label, with its owner, to coefficient.
    added : list of ndarray
        What it adds to each shot. [unit of the signal]
    residual : list of ndarray
        What is left of each shot. [unit of the signal]
    chi2 : float
        Whitened squares left.
    rms, heldout_rms : float, float or None
        Pooled residual; the same on shots the closure was not learned on. [unit of the signal]
    """

    parts: tuple[Part, ...]
    problem: JointProblem
    fitted: joint.Fitted
    evidence: Evidence
    coefficients: dict[str, float]
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
        """Return the owners, joined."""
        return "+".join(s for _, s in self.parts)


def _whole(parts: Sequence[Part]) -> list[str]:
    """Return the families that hold the columns of some parts."""
    return list(dict.fromkeys(PARTS[f][0] if f in PARTS else f for f, _ in parts))


def _without(problem: JointProblem, added: Sequence[Array]) -> JointProblem:
    """Return the problem with what a closure adds taken off the records."""
    shots = [_taken_off(item, a) for item, a in zip(problem.shots, added, strict=True)]
    return dataclasses.replace(problem, shots=shots)


def _taken_off(item: FitShot, added: Array) -> FitShot:
    window = dataclasses.replace(item.window, signal=item.window.signal - added)
    return dataclasses.replace(item, window=window)


def _added(evidence: Evidence, system: System, coefficients: Array) -> list[Array]:
    """Return what coefficients add to each shot, by the evidence's columns."""
    found = []
    for row, shot in enumerate(evidence.shots):
        s = shot.chain.shape[0]
        own = system.chains[row][s:, system.globals_ :] @ coefficients
        found.append(shot.columns @ own)
    return found


def _ridged(system: System, coefficients: Array, width: float) -> tuple[Array, Array]:
    """Return the normal equations with the coefficients' ridge about zero."""
    ridge = np.zeros(system.load.size)
    ridge[system.globals_ :] = width**-2
    load = system.load.copy()
    load[system.globals_ :] -= coefficients * width**-2
    return system.whole + np.diag(ridge), load


@dataclass(frozen=True)
class _Place:
    """One point of the search: a fit, its evidence, and where it would go next."""

    found: Learned
    system: System
    coefficients: Array
    step: Array
    width: float


def _look(
    problem: JointProblem,
    begin: joint.Fitted,
    parts: tuple[Part, ...],
    *,
    added: list[Array],
    coefficients: Array | None,
    width: float | None,
    refit: bool,
) -> _Place | None:
    """Return the fit to the records less an addition, None where there is none."""
    reduced = _without(problem, added)
    fitted = begin
    if refit:
        fitted = joint.fit(reduced, begin.nuisances, theta=begin.theta, max_iterations=FIT_STEPS)
    if not fitted.blocks:
        return None
    evidence = gather(reduced, fitted, wanted=_whole(parts))
    system = evidence.system(parts)
    size = np.zeros(len(system.labels)) if coefficients is None else coefficients
    if width is None:
        width = evidence.best_width(system, WIDTHS)
    whole, load = _ridged(system, size, width)
    step = np.asarray(np.linalg.solve(whole, load))[system.globals_ :]
    found = dataclasses.replace(_learned(parts, evidence, system, size), added=added)
    return _Place(found, system, size, step, width)


def _descend(problem: JointProblem, here: _Place, rounds: int) -> tuple[_Place, bool]:
    """Return where a search ends, and whether any step made it better."""
    share, moved = 1.0, False
    for _ in range(rounds):
        coefficients = here.coefficients + share * here.step
        ahead = _look(
            problem,
            here.found.fitted,
            here.found.parts,
            added=_added(here.found.evidence, here.system, coefficients),
            coefficients=coefficients,
            width=here.width,
            refit=True,
        )
        if ahead is None or not ahead.found.chi2 < here.found.chi2:
            share /= 4
            continue
        agreed = ahead.found.chi2 > (1.0 - AGREED) * here.found.chi2
        here, moved, share = ahead, True, min(1.0, 2 * share)
        if agreed:
            break
    return here, moved


def learn(problem: JointProblem, fitted: joint.Fitted, parts: Sequence[Part]) -> Learned | None:
    """Fit a closure and the present model to each other.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        The present model at its best.
    parts : sequence of tuple
        (family, scope) of the columns.

    Returns
    -------
    Learned or None
        The best that was reached; None where no step made it better.
    """
    nothing = [np.zeros(s.frame.samples) for s in problem.shots]
    start = _look(
        problem, fitted, tuple(parts), added=nothing, coefficients=None, width=None, refit=False
    )
    if start is None:
        return None
    here, moved = _descend(problem, start, ROUNDS)
    if not moved:
        return None
    return dataclasses.replace(here.found, heldout_rms=_heldout(problem, here))


def _learned(
    parts: tuple[Part, ...], evidence: Evidence, system: System, coefficients: Array
) -> Learned:
    """Return a point of the search as a closure, not yet tried on held-out shots."""
    residual = [s.residual for s in evidence.shots]
    squares = sum(float(r @ r) for r in residual)
    return Learned(
        parts,
        evidence.problem,
        evidence.fitted,
        evidence,
        dict(zip(system.labels, map(float, coefficients), strict=True)),
        [],
        residual,
        evidence.chi2,
        math.sqrt(squares / sum(r.size for r in residual)),
        None,
    )


def _heldout(problem: JointProblem, here: _Place) -> float | None:
    """Return the residual of shots that neither globals nor closure were fitted to.

    Folds as for any other model. Globals and coefficients are learned anew on the other shots; the
    fold's own nuisances are then fitted with everything shared fixed.
    """
    folds = heldout_folds(problem)
    if not folds:
        return None
    squares, count = 0.0, 0
    for fold in folds:
        kept = [i for i in range(len(problem.shots)) if i not in fold]
        learned = _learned_on(problem, here, kept)
        if learned is None:
            return None
        theta, coefficients = learned
        own = _without(problem, _added(here.found.evidence, here.system, coefficients))
        own = dataclasses.replace(own, shots=[own.shots[i] for i in fold])
        begin = here.found.fitted.nuisances[fold]
        nuisances = joint.settle(own, theta, begin)
        for item, nuisance in zip(own.shots, nuisances, strict=True):
            shared, _ = own.shared_local(item, theta)
            seen = own.model.predict(np.concatenate([shared, nuisance]), item.frame)
            r = item.window.signal - seen.signal
            squares += float(r @ r)
            count += r.size
    return math.sqrt(squares / count)


def _learned_on(
    problem: JointProblem, here: _Place, kept: list[int]
) -> tuple[Array, Array] | None:
    """Return globals and coefficients that some of the shots lead to."""
    few = dataclasses.replace(problem, shots=[problem.shots[i] for i in kept])
    fitted = here.found.fitted
    start = _look(
        few,
        dataclasses.replace(fitted, nuisances=fitted.nuisances[kept]),
        here.found.parts,
        added=[here.found.added[i] for i in kept],
        coefficients=here.coefficients,
        width=here.width,
        refit=True,
    )
    if start is None or start.coefficients.size != here.coefficients.size:
        return None
    end, _ = _descend(few, start, FOLD_ROUNDS)
    return end.found.fitted.theta, end.coefficients


def learn_force(
    problem: JointProblem,
    fitted: joint.Fitted,
    evidence: Evidence,
    *,
    forms: Sequence[str],
    scope: str,
) -> Learned | None:
    """Fit a contact force of free form, integrated as any contact law is.

    Parameters
    ----------
    problem, fitted, evidence : JointProblem, Fitted, Evidence
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
        ahead = joint.fit(wide, nuisances, theta=theta)
        if not ahead.blocks:
            return None
        found = ahead
    ending = gather(wide, found, wanted=("speed",))
    residual = [s.residual for s in ending.shots]
    squares = sum(float(r @ r) for r in residual)
    first = len(problem.names)
    coefficients = {
        name.removeprefix("closure_"): float(value)
        for name, value in zip(wide.names[first:], found.theta[first:], strict=True)
    }
    added = [old.residual - r for old, r in zip(evidence.shots, residual, strict=True)]
    return Learned(
        tuple((f"force_{form}", scope) for form in forms),
        wide,
        found,
        ending,
        coefficients,
        added,
        residual,
        ending.chi2,
        math.sqrt(squares / sum(r.size for r in residual)),
        heldout_or_none(wide, found),
    )
