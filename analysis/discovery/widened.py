"""Whose is an effect's size: what was found for the rig, asked again of each material and shot.

A linear look chooses the owner before the effect is known. Once it is fitted, the other owners are
one refit away.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.candidates import Refit, extended, refitted, rescoped, scopes_of
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem


def widened(problem: JointProblem, base: joint.Fitted, found: Refit, penalty: float) -> Refit:
    """Return an effect's refit with the owner of its size that explains most, numbers paid for.

    Parameters
    ----------
    problem, base : JointProblem, Fitted
        The model without the effect.
    found : Refit
        On all shots.
    penalty : float
        Price of a number in whitened squares.

    Returns
    -------
    Refit
        ``found`` itself where no other owner does better.
    """
    best = found
    for scope in scopes_of(found.effect):
        if scope != found.scope and _owners(problem, scope) > 1:
            other = _owned_by(scope, problem, base, found)
            if not other.at_bound and other.score(penalty) > best.score(penalty):
                best = other
    return best


def _owners(problem: JointProblem, scope: str) -> int:
    if scope == "shot":
        return len(problem.shots)
    return len({getattr(s.shot, scope) for s in problem.shots}) if scope != "rig" else 1


def _owned_by(scope: str, problem: JointProblem, base: joint.Fitted, found: Refit) -> Refit:
    """Return the refit with another owner, started from where it is."""
    effect = rescoped(found.effect, scope)
    larger, theta, _ = extended(problem, base, effect, {})
    old, new = found.problem.model, larger.model
    known = dict(zip(found.problem.names, found.fitted.theta, strict=True))
    theta = np.array([known.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = carried_over(old, new, found.fitted.nuisances)
    for parameter, at in zip(effect.parameters, new.places[effect.id], strict=True):
        before = old.names.index(f"{effect.id}.{parameter.name}")
        values = _values(found, before)
        if parameter.scope == "shot":
            nuisances[:, at - len(new.shared)] = values
            continue
        keys = np.array([larger.effect_key(at, s) for s in problem.shots])
        for key in set(keys):
            theta[larger.names.index(key)] = values[keys == key].mean()
    result = joint.fit(larger, nuisances, theta=theta)
    other = dataclasses.replace(found, effect=effect, scope=scope, problem=larger, fitted=result)
    return refitted(other, problem, base)


def _values(found: Refit, at: int) -> NDArray[np.float64]:
    """Return the coordinate of one local parameter in every shot."""
    model = found.problem.model
    if at >= len(model.shared):
        return found.fitted.nuisances[:, at - len(model.shared)]
    shots = found.problem.shots
    return np.array([found.problem.shared_local(s, found.fitted.theta)[0][at] for s in shots])
