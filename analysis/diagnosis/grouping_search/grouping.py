"""Whose is an effect's size: what was found for the rig, asked again of each material and shot.

A linear look chooses the group before the effect is known. Once it is fitted, the other groups are
one refit away.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.proposals import rescoped, scopes_of
from analysis.diagnosis.candidates.refit import Refit, extended, refitted
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem


def best_grouping(problem: JointProblem, base: joint.Fitted, found: Refit) -> Refit:
    """Return an effect's refit with the group of its size that explains most, numbers paid for.

    Parameters
    ----------
    problem, base : JointProblem, Fitted
        The model without the effect.
    found : Refit
        On all shots.

    Returns
    -------
    Refit
        ``found`` itself where no other group does better.
    """
    best = found
    for effect, scope in _others(problem, found):
        other = _owned_by(effect, scope, problem, base, found)
        if other.own and not found.own:
            other = dataclasses.replace(other, common=found.gain)
        if not other.at_bound and other.score() > best.score():
            best = other
    return best


def _others(problem: JointProblem, found: Refit) -> Iterator[tuple[Effect, str]]:
    """Return the other groups worth a refit, those beyond one material among them."""
    effect = found.effect
    for scope in scopes_of(effect):
        if scope != found.scope and _groups(problem, effect, scope) > 1:
            yield effect, scope
    if effect.only is not None and {effect.only[0], "rig"} <= set(scopes_of(effect)):
        everybody = dataclasses.replace(effect, only=None)
        if _groups(problem, everybody, effect.only[0]) > 1:
            yield everybody, "rig"
            yield everybody, effect.only[0]


def _groups(problem: JointProblem, effect: Effect, scope: str) -> int:
    """Return among how many an effect's size can be shared out, of those that feel it."""
    if scope == "rig":
        return 1  # where the search began
    felt = [s.shot for s in problem.shots if effect.acts_on(s.shot.sphere, s.shot.surface)]
    return len(felt) if scope == "shot" else len({getattr(s, scope) for s in felt})


def _owned_by(
    wanted: Effect, scope: str, problem: JointProblem, base: joint.Fitted, found: Refit
) -> Refit:
    """Return the refit with another group, started from where it is."""
    effect = rescoped(wanted, scope)
    larger, theta, _ = extended(problem, base, effect, {})
    old, new = found.problem.model, larger.model
    known = dict(zip(found.problem.names, found.fitted.theta, strict=True))
    theta = np.array([known.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = carried_over(old, new, found.fitted.nuisances)
    felt = np.array([found.effect.acts_on(s.shot.sphere, s.shot.surface) for s in problem.shots])
    for parameter, at in zip(effect.parameters, new.places[effect.id], strict=True):
        before = old.names.index(f"{effect.id}.{parameter.name}")
        values = _values(found, before)
        if parameter.scope == "shot":
            nuisances[:, at - len(new.shared)] = values
            continue
        keys = np.array([larger.effect_key(at, s) or "" for s in problem.shots])
        for key in larger.effect_keys(at):
            if (felt & (keys == key)).any():  # who did not feel it begins next to neutral
                theta[larger.names.index(key)] = values[felt & (keys == key)].mean()
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
