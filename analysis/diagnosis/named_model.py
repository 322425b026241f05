"""An accepted model with a name and the numbers that were found for it.

A definition is JSON::

    {"name": "kv+coupler_highpass", "base": "kv",
     "effects": [{"id": "coupler_highpass", "owners": {"time_constant_s": "rig"},
                  "numbers": {"coupler_highpass.time_constant_s": {"coordinate": ..., "u": ...}}}]}

``coordinate`` is the one that the effect is fitted in (``EffectParameter.form``). A single shot,
which could not tell an effect's numbers, is fitted with them as priors; a campaign fits them anew.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

from analysis.aliases import Json
from analysis.campaign import Campaign
from analysis.diagnosis.held_out import as_fit_result
from analysis.effects.acts_on import ActsOn
from analysis.effects.library import effect_named
from analysis.errors import UnknownModelError
from analysis.fit import joint
from analysis.fit.freed_inputs import inputs_freed
from analysis.fit.joint import Fitted
from analysis.fit.problem import JointProblem, build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.model.impact_model import ImpactModel, model_named

LEAST_U = 1e-6
"""A prior that is sharper only makes the equations stiff."""


def definition_of(problem: JointProblem, fitted: Fitted) -> Json | None:
    """Return the definition of a model at its best, None for a base model.

    With the covariance widened where it must be.
    """
    model = problem.model
    if not model.effects or fitted.failed:
        return None
    effects = []
    for effect in model.effects:
        numbers = {}
        for j, name in enumerate(problem.names):
            if name.is_of(effect.id):
                u = math.sqrt(max(float(fitted.covariance[j, j]), LEAST_U**2))
                numbers[name] = {"coordinate": float(fitted.theta[j]), "u": u}
        groups = {p.name: p.scope for p in effect.parameters}
        entry = {"id": effect.id, "owners": groups, "numbers": numbers}
        effects.append(entry | ({"only": effect.only.to_json()} if effect.only else {}))
    return {"name": model.name, "base": model.base_name, "effects": effects}


def model_of(definition: Json) -> ImpactModel:
    """Return the model of a definition, each effect's numbers with the groups they were found for.

    UnknownModelError if this version does not know the base or an effect, or no longer knows its
    numbers.
    """
    model = model_named(definition["base"])
    for entry in definition["effects"]:
        effect, groups = effect_named(entry["id"]), entry["owners"]
        if set(groups) != {p.name for p in effect.parameters}:
            raise UnknownModelError(
                f"The effect {effect.id} has other numbers today than when the model was named; "
                "diagnose again."
            )
        parameters = (dataclasses.replace(p, scope=groups[p.name]) for p in effect.parameters)
        only = ActsOn.from_json(entry["only"]) if entry.get("only") else None
        model = model.with_effect(
            dataclasses.replace(effect, parameters=tuple(parameters), only=only)
        )
    return model


def fit_named(
    campaign: Campaign,
    definition: Json,
    *,
    by_pair: bool = False,
    heldout: bool = True,
    priors: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> FitResult:
    """Fit a campaign with an accepted model.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    definition : dict
        From `definition_of`.
    by_pair : bool
        A stiffness per pair instead of a modulus per material; for single shots.
    heldout : bool
        Also compute the error on held-out shots.
    priors : bool
        Take the effects' numbers as known from the diagnosis; not for shots that it has seen
        itself, which would then count twice.
    progress : callable, optional
        Told what is being done and a share between 0 and 1.

    Raises
    ------
    UnknownModelError
        If this version cannot build the model.
    AnalysisError
        If no shot can be used at all.
    """
    problem = build(campaign, model_of(definition), by_pair=by_pair)
    known = {name: q for entry in definition["effects"] for name, q in entry["numbers"].items()}
    if priors:
        _put_priors(problem, known)
    problem, nuisances = with_start(problem)
    for name, quantity in known.items():
        j = problem.index(name)
        if j is not None:
            problem.start[j] = quantity["coordinate"]
    fitted = joint.fit(problem, nuisances, progress=progress)
    return inputs_freed(as_fit_result(problem, fitted, heldout=heldout))


def _put_priors(problem: JointProblem, known: Json) -> None:
    """Add what is known to a problem as it is stated."""
    for j, name in enumerate(problem.names):
        if name in known:
            precision = float(known[name]["u"]) ** -2
            problem.prior_precision[j, j] = precision
            problem.prior_mean[j] = float(known[name]["coordinate"])
        elif name.kind == "effect":
            problem.assumptions.append(
                f"{name} was not part of the diagnosis; it was fitted from these shots alone."
            )
