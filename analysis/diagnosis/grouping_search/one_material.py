"""Does one material make the difference? Then the rest knows the cell, and its shots the effect.

Where the shots of every other coupon, or of every other sphere, are plain noise under the present
model, they tell the cell and the materials that are shared as if nothing were the matter. What is
looked for then acts on one material's shots alone, from a place that it has not itself bent.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.form_error import discrepancy
from analysis.diagnosis.basis.proposals import proposals, scopes_of
from analysis.diagnosis.candidates.other_forms import best_form
from analysis.diagnosis.candidates.refit import Refit, extended, refitted
from analysis.diagnosis.candidates.subsets import PresentModel
from analysis.diagnosis.candidates.successive_halving import rank, ranked
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.grouping_search.grouping import best_grouping
from analysis.diagnosis.grouping_search.without_material import (
    MOST_STEPS,
    WithoutMaterial,
    chance,
    excess,
    far_begin,
    part_of_shots,
)
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.method_steps import Progress
from analysis.diagnosis.score_test import run_score_test
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.problem import JointProblem
from analysis.fit.settle import settle

Array = NDArray[np.float64]

MOST_MATERIALS = 2
SLOTS = ("contact", "mounting")
"""Where an effect can belong to one material."""


def can_be_one_materials(effect: Effect) -> bool:
    """Tell whether an effect is done with where it was tried on one material's shots alone.

    Parameters
    ----------
    effect : Effect
        Of the library.

    Returns
    -------
    bool
        False where the whole rig has it, and it can hide on all other shots: a stiff tape moves
        their coupons with the crystal, as if the crystal were heavier.
    """
    return effect.slot in SLOTS and scopes_of(effect) != ("rig",)


def _can_be_felt_by_one(effect: Effect) -> bool:
    """Tell whether an effect may show on one material's shots only, as a ceiling on the highest."""
    return effect.slot in SLOTS or any(p.peak_starts for p in effect.parameters)


@dataclass(frozen=True)
class OneMaterial:
    """One material's shots, under what all the others say.

    Attributes
    ----------
    rest : WithoutMaterial
        Which material, and the other shots.
    problem, fitted : JointProblem, Fitted
        Its shots alone; what they share with the others is known as well as those know it.
    usual : Fitted
        The same, where the rig was before any record but for what the others tell.
    """

    rest: WithoutMaterial
    problem: JointProblem
    fitted: joint.Fitted
    usual: joint.Fitted


def single_materials(
    present: PresentModel, without: list[WithoutMaterial]
) -> Iterator[OneMaterial]:
    """Yield the materials without whose shots the present model is adequate, likeliest first.

    Parameters
    ----------
    present : PresentModel
        The present model at its best, which is not adequate, and where it would be without a
        record.
    without : list of WithoutMaterial
        From `without_each_material`.

    Yields
    ------
    OneMaterial
        Nothing where there is no such material; a sphere and a coupon where the shots of both
        together make the difference; at most `MOST_MATERIALS`.
    """
    beyond = excess(present.problem, present.fitted)
    for rest in without[:MOST_MATERIALS]:
        if rest.left > CRITERIA.grouping.outside_share * beyond + chance(present.problem):
            return
        small = rest.left <= CRITERIA.grouping.unrelated_share * beyond
        inexact = discrepancy(rest.problem, rest.fitted)
        if (
            not small
            and run_score_test(linearise(rest.problem, rest.fitted, inexact=inexact)).structured
        ):
            return
        yield apart_from(present, rest, far_begin(present))


def apart_from(present: PresentModel, rest: WithoutMaterial, begin: joint.Fitted) -> OneMaterial:
    """Return one material's shots under what the rest says of all that they share.

    Parameters
    ----------
    present : PresentModel
        The present model on all shots.
    rest : WithoutMaterial
        The others.
    begin : Fitted
        Where the present model begins, on all shots.

    Returns
    -------
    OneMaterial
        The present model fitted to the one material's shots.
    """
    part, kept = part_of_shots(present.problem, rest.places)
    start = dataclasses.replace(
        begin, theta=begin.theta[kept], nuisances=begin.nuisances[rest.places]
    )
    alone = _alone(part, start, rest.problem, rest.fitted)
    before = present.usual.theta.copy()
    for j, name in enumerate(present.problem.names[: before.size]):
        at = rest.problem.index(name)
        before[j] = before[j] if at is None else rest.fitted.theta[at]
    usual = dataclasses.replace(
        present.usual,
        theta=before[[j for j in kept if j < before.size]],
        nuisances=present.usual.nuisances[rest.places],
    )
    return OneMaterial(rest, part, alone, usual)


def _alone(
    part: JointProblem, begin: joint.Fitted, rest: JointProblem, known: joint.Fitted
) -> joint.Fitted:
    """Fit one material's shots, what they share with the rest known as well as there."""
    own = [j for j, name in enumerate(part.names) if name in rest.names]
    other = [rest.names.index(part.names[j]) for j in own]
    part.start = begin.theta.copy()
    part.prior_mean, part.prior_precision = part.prior_mean.copy(), part.prior_precision.copy()
    part.start[own] = part.prior_mean[own] = known.theta[other]
    part.prior_precision[np.ix_(own, own)] = np.linalg.inv(known.covariance[np.ix_(other, other)])
    nuisances = settle(part, part.start, begin.nuisances)
    return joint.fit(part, nuisances, max_iterations=MOST_STEPS)


def tried_alone(
    apart: OneMaterial, present: PresentModel, progress: Progress, *, first: bool
) -> list[Refit]:
    """Return the effects that one material can have or feel, refitted where they act alone.

    Parameters
    ----------
    apart : OneMaterial
        The material and its shots.
    present : PresentModel
        The present model on all shots.
    progress : callable
        Told what is being done and a share between 0 and 1.
    first : bool
        Nothing was added yet.

    Returns
    -------
    list of Refit
        The best few fitted to all shots, best first; the rest behind them, their gain as it would
        be there.
    """
    inner = PresentModel(apart.problem, apart.fitted, apart.usual)
    tried = [p for p in proposals(apart.problem)[0] if _can_be_felt_by_one(p.effect)]
    already = present.fitted.cost - apart.rest.fitted.cost - apart.fitted.cost
    refits = ranked(inner, tried, progress, first=first, alone=True)
    if refits and not _is_noise(apart.problem, refits[0].fitted):
        near = best_form(apart.problem, apart.fitted, refits[0])
        refits[0] = best_grouping(apart.problem, apart.fitted, near, of_some=False)
    found = []
    for one in refits:
        if one.on_all_shots and one.effect.slot not in SLOTS:
            found.append(everywhere(one, apart, present.problem, present.fitted))
            continue
        if one.on_all_shots and one.effect.structure is not None:
            # light coupons hide in the crystal's mass what is below all of them alike
            under_all = everywhere(one, apart, present.problem, present.fitted)
            if explains_all(under_all, present):
                others = [r for r in refits if r is not one]
                left = [
                    dataclasses.replace(r, gain=r.gain + already, on_all_shots=False)
                    for r in others
                ]
                return sorted([under_all, *left], key=rank)
            found.append(under_all)
        if one.on_all_shots:
            found.append(on_all_shots(one, apart, present.problem, present.fitted))
        else:
            found.append(dataclasses.replace(one, gain=one.gain + already))
    return sorted(found, key=rank)


def explains_all(found: Refit, present: PresentModel) -> bool:
    """Tell whether so much was explained, down to the noise, that no other slot need be asked."""
    certain = found.usable and found.gain > CRITERIA.grouping.certain_squares
    return certain and _is_noise(present.problem, found.fitted)


def _is_noise(problem: JointProblem, fitted: joint.Fitted) -> bool:
    return excess(problem, fitted) < chance(problem)


def on_all_shots(
    found: Refit, apart: OneMaterial, problem: JointProblem, fitted: joint.Fitted
) -> Refit:
    """Return an effect that was found on one material's shots as part of the whole campaign.

    Parameters
    ----------
    found : Refit
        On those shots.
    apart : OneMaterial
        Whose they are.
    problem, fitted : JointProblem, Fitted
        The model without the effect, on all shots.

    Returns
    -------
    Refit
        Fitted again; the other shots do not feel the effect.
    """
    rest = apart.rest
    effect = dataclasses.replace(found.effect, only=rest.only)
    larger, theta, _ = extended(problem, fitted, effect, {})
    where = dict(zip(rest.problem.names, rest.fitted.theta, strict=True))
    for name, value in zip(found.problem.names, found.fitted.theta, strict=True):
        where.setdefault(_owned(name, effect, rest.only.label), float(value))
    theta = np.array([where.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = _shots_own(larger, problem, fitted, apart.rest, found)
    result = joint.fit(larger, nuisances, theta=theta, max_iterations=MOST_STEPS)
    scope = rest.only.kind if found.scope == "rig" else found.scope
    whole = dataclasses.replace(
        found, effect=effect, scope=scope, problem=larger, fitted=result, on_all_shots=True
    )
    return refitted(whole, problem, fitted)


def everywhere(
    found: Refit, apart: OneMaterial, problem: JointProblem, fitted: joint.Fitted
) -> Refit:
    """Return an effect that was found on one material's shots as one that acts on all shots.

    Parameters
    ----------
    found, apart, problem, fitted
        As for `on_all_shots`.

    Returns
    -------
    Refit
        Fitted again from the cell and the sizes that the one material's shots have.
    """
    larger, theta, _ = extended(problem, fitted, found.effect, {})
    where = dict(zip(apart.rest.problem.names, apart.rest.fitted.theta, strict=True))
    where |= dict(zip(found.problem.names, found.fitted.theta, strict=True))
    theta = np.array([where.get(n, v) for n, v in zip(larger.names, theta, strict=True)])
    nuisances = _shots_own(larger, problem, fitted, apart.rest, found)
    nuisances = settle(larger, theta, nuisances)
    result = joint.fit(larger, nuisances, theta=theta, max_iterations=MOST_STEPS)
    whole = dataclasses.replace(found, problem=larger, fitted=result, on_all_shots=True)
    return refitted(whole, problem, fitted)


def _shots_own(
    larger: JointProblem,
    problem: JointProblem,
    fitted: joint.Fitted,
    rest: WithoutMaterial,
    found: Refit,
) -> Array:
    """Return every shot's own numbers from where its material was fitted. Shape (shots, p)."""
    nuisances = carried_over(problem.model, larger.model, fitted.nuisances)
    shared = [larger.model.nuisances.index(n) for n in problem.model.nuisances]
    nuisances[np.ix_(rest.others, shared)] = rest.fitted.nuisances
    nuisances[rest.places] = found.fitted.nuisances
    return nuisances


def _owned(name: str, effect: Effect, group: str) -> str:
    """Return the name that a number of the effect has where it belongs to one material."""
    return f"{name}[{group}]" if name.startswith(f"{effect.id}.") and "[" not in name else name
