"""Two effects of which one is one material's: the other is found first, on the shots without it.

What both do at once can look like neither. Without the right material's shots only one effect is
left, which the search finds as if it were alone; on that material's shots it is then known.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from analysis.discovery.candidates import KNOWN_BEFORE, Refit, extended, refitted
from analysis.discovery.criteria import CRITERIA
from analysis.discovery.isolated import apart_from, tried_alone
from analysis.discovery.left_out import LeftOut, excess
from analysis.discovery.method_steps import MethodStep, Progress
from analysis.discovery.parts import Ground
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle

MATERIALS_TRIED = 2

Alone = Callable[[JointProblem, joint.Fitted, joint.Fitted, Progress], Refit | None]
"""Search one effect that leaves noise: problem, fitted, usual place, progress -> refit."""


def divided(
    ground: Ground, without: list[LeftOut], alone: Alone, progress: Progress
) -> tuple[Refit, list[Refit]] | None:
    """Return a first effect, found without one material, and what then acts on that material.

    Parameters
    ----------
    ground : Ground
        The present model on all shots.
    without : list of LeftOut
        From `left_out`.
    alone : callable
        The search for a single effect.
    progress : callable
        Told what is being done and a share between 0 and 1.

    Returns
    -------
    tuple or None
        The first effect fitted to all shots, and the second ones on top of it, best first; None
        where nothing is found.
    """
    whole = excess(ground.problem, ground.fitted)
    simpler = [w for w in without if w.left < CRITERIA.grouping.simpler_share * w.share * whole]
    for rest in sorted(simpler, key=lambda w: w.left / w.share)[:MATERIALS_TRIED]:
        progress(MethodStep.ON_TOP.told(f"searching without {rest.only[1]}"), 0.5)
        usual = _usual_of(ground, rest)
        first = alone(rest.problem, rest.fitted, usual, progress)
        if first is None:
            continue
        larger, begin = _on_all(ground, rest, first)
        fitted = joint.fit(larger, begin.nuisances, theta=begin.theta)
        if not fitted.blocks:
            continue
        taken = dataclasses.replace(first, problem=larger, fitted=fitted, on_all_shots=True)
        taken = refitted(taken, ground.problem, ground.fitted)
        known = dataclasses.replace(rest, problem=first.problem, fitted=first.fitted)
        wider = Ground(larger, fitted, ground.usual)
        found = tried_alone(apart_from(wider, known, begin), wider, progress, first=True)
        if found:
            return taken, found
    return None


def _usual_of(ground: Ground, rest: LeftOut) -> joint.Fitted:
    """Return the usual place for some of the shots."""
    names = ground.problem.names[: ground.usual.theta.size]
    kept = [j for j, name in enumerate(names) if rest.problem.index(name) is not None]
    return dataclasses.replace(
        ground.usual,
        theta=ground.usual.theta[kept],
        nuisances=ground.usual.nuisances[rest.others],
    )


def _on_all(ground: Ground, rest: LeftOut, first: Refit) -> tuple[JointProblem, joint.Fitted]:
    """Return the whole problem with the first effect, and where its fit begins."""
    larger, theta, _ = extended(ground.problem, ground.fitted, first.effect, {})
    before = dict(zip(ground.problem.names, ground.usual.theta, strict=False))
    known = dict(zip(first.problem.names, first.fitted.theta, strict=True))
    theta = np.array(
        [known.get(n, before.get(n, v)) for n, v in zip(larger.names, theta, strict=True)]
    )
    base = ground.fitted.nuisances.copy()
    base[:, : ground.usual.nuisances.shape[1]] = ground.usual.nuisances
    nuisances = carried_over(ground.problem.model, larger.model, base)
    nuisances = settle(larger, theta, nuisances, kept=KNOWN_BEFORE)
    nuisances[rest.others] = first.fitted.nuisances
    return larger, dataclasses.replace(ground.fitted, theta=theta, nuisances=nuisances)
