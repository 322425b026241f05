"""Two effects of which one is one material's: the other is found first, on the shots without it.

What both do at once can look like neither. Without the right material's shots only one effect is
left, which the search finds as if it were alone; on that material's shots it is then known.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import numpy as np

from analysis.diagnosis.candidates.refit import KNOWN_BEFORE, Refit, extended, refitted
from analysis.diagnosis.candidates.subsets import PresentModel
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.grouping_search.one_material import apart_from, tried_alone
from analysis.diagnosis.grouping_search.without_material import WithoutMaterial, excess
from analysis.diagnosis.progress import MethodStep, Progress
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle

MATERIALS_TRIED = 2

Alone = Callable[[JointProblem, joint.Fitted, joint.Fitted, Progress], Refit | None]
"""Search one effect that leaves noise: problem, fitted, usual place, progress -> refit."""


def split_by_material(
    present: PresentModel, without: list[WithoutMaterial], alone: Alone, progress: Progress
) -> tuple[Refit, list[Refit]] | None:
    """Return a first effect, found without one material, and what then acts on that material.

    Parameters
    ----------
    present : PresentModel
        The present model on all shots.
    without : list of WithoutMaterial
        From `without_each_material`.
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
    whole = excess(present.problem, present.fitted)
    simpler = [w for w in without if w.left < CRITERIA.grouping.simpler_share * w.share * whole]
    for rest in sorted(simpler, key=lambda w: w.left / w.share)[:MATERIALS_TRIED]:
        progress(MethodStep.ON_TOP.told(f"searching without {rest.only.label}"), 0.5)
        usual = _usual_of(present, rest)
        first = alone(rest.problem, rest.fitted, usual, progress)
        if first is None:
            continue
        larger, begin = _on_all(present, rest, first)
        fitted = joint.fit(larger, begin.nuisances, theta=begin.theta)
        if not fitted.blocks:
            continue
        taken = dataclasses.replace(first, problem=larger, fitted=fitted, on_all_shots=True)
        taken = refitted(taken, present.problem, present.fitted)
        known = dataclasses.replace(rest, problem=first.problem, fitted=first.fitted)
        wider = PresentModel(larger, fitted, present.usual)
        found = tried_alone(apart_from(wider, known, begin), wider, progress, first=True)
        if found:
            return taken, found
    return None


def _usual_of(present: PresentModel, rest: WithoutMaterial) -> joint.Fitted:
    """Return the usual place for some of the shots."""
    names = present.problem.names[: present.usual.theta.size]
    kept = [j for j, name in enumerate(names) if rest.problem.index(name) is not None]
    return dataclasses.replace(
        present.usual,
        theta=present.usual.theta[kept],
        nuisances=present.usual.nuisances[rest.others],
    )


def _on_all(
    present: PresentModel, rest: WithoutMaterial, first: Refit
) -> tuple[JointProblem, joint.Fitted]:
    """Return the whole problem with the first effect, and where its fit begins."""
    larger, theta, _ = extended(present.problem, present.fitted, first.effect, {})
    before = dict(zip(present.problem.names, present.usual.theta, strict=False))
    known = dict(zip(first.problem.names, first.fitted.theta, strict=True))
    theta = np.array(
        [known.get(n, before.get(n, v)) for n, v in zip(larger.names, theta, strict=True)]
    )
    base = present.fitted.nuisances.copy()
    base[:, : present.usual.nuisances.shape[1]] = present.usual.nuisances
    nuisances = carried_over(present.problem.model, larger.model, base)
    nuisances = settle(larger, theta, nuisances, kept=KNOWN_BEFORE)
    nuisances[rest.others] = first.fitted.nuisances
    return larger, dataclasses.replace(present.fitted, theta=theta, nuisances=nuisances)
