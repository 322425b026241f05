"""The search over the forms of an effect, each started from the best form so far.

From afar only one form may have found its way: a yield force does where a yield pressure, whose
threshold moves with a modulus that the yield itself hides, never acts. And the fit of one form may
have ended in a valley beside the deepest one.
"""

from __future__ import annotations

import dataclasses
import math
from functools import partial
from itertools import product

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.candidate import (
    STEPS_FROM_NEAR,
    Refit,
    extended,
    fitted_coordinate,
    refitted,
)
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.successive_halving import as_good_on_part, better_on_part
from analysis.effects.effect import Effect
from analysis.effects.library import library
from analysis.fit import joint
from analysis.fit.nuisances import carried_over
from analysis.fit.physical_range import HARDLY
from analysis.fit.problem import JointProblem

STARTS_FITTED = 2
"""Of a form, the cheapest before any fit. Chosen by trial."""
FINER = 3
"""Starts between each two of a threshold's own."""


def best_form(problem: JointProblem, base: joint.Fitted, found: Refit) -> Refit:
    """Return an effect's refit in the form that explains most.

    Forms are held against one another on shots that stand for all; the best of another is then
    fitted to all, where it must be ahead again. ``found`` itself where no other form does better,
    or its numbers belong to single shots. Forms that no search tries (`Effect.by_name`) are asked
    where this one explains nearly all: then the effect is known, and its law is not yet.
    """
    missing = base.cost - sum(item.expected_squares for item in problem.shots)
    explains_nearly_all = found.gain >= CRITERIA.nearly_all * missing
    forms = _forms_of(problem, found, rare=explains_nearly_all)
    if not forms:
        return found

    def of_forms(few: JointProblem, few_base: joint.Fitted, known: Refit) -> Refit:
        """Return the refit in the best form on some shots."""
        return max((known, *_in_forms(forms, few, few_base, known)), key=Refit.score)

    return better_on_part(problem, base, found, of_forms)


def forms_as_good(problem: JointProblem, base: joint.Fitted, found: Refit) -> list[Refit]:
    """Return an effect's refits in the other forms that the data do not tell from its own.

    Rare forms are among them, but none with more numbers: that may hold this one, and explains as
    much at any rate. Forms that shots which stand for all do not tell apart are fitted to all.
    """
    size = len(found.effect.parameters)
    forms = [
        form
        for form in _forms_of(problem, found, rare=True)
        if form.id != found.effect.id and len(form.parameters) <= size
    ]
    if not forms:
        return []
    near = as_good_on_part(problem, base, found, partial(_in_forms, forms))
    return [one for one in near if found.score() - one.score() < CRITERIA.least_lead]


def _forms_of(problem: JointProblem, found: Refit, *, rare: bool) -> list[Effect]:
    """Return the forms of an effect that can be fitted from another's best, its own in valleys.

    ``rare`` says whether those that no search tries are among them. Empty where its numbers belong
    to single shots.
    """
    entry = library()[found.effect_id]
    scopes = [p.scope for p in found.effect.parameters]
    if not scopes or "shot" in scopes:
        return []
    return [
        form
        for form in (entry, *entry.variants)
        if (form.id != found.effect.id or any(p.valleys for p in form.parameters))
        and form.basis is None
        and form.parameters
        and (rare or not form.by_name)
        and problem.model.base in form.bases
    ]


def _in_forms(
    forms: list[Effect], problem: JointProblem, base: joint.Fitted, known: Refit
) -> list[Refit]:
    """Return an effect's refits in other forms, but for those out of their range."""

    def in_form(form: Effect) -> Refit:
        """Return the refit in another form."""
        return _in_form(_grouped_as(form, known.effect), problem, base, known)

    return [one for one in problem.each(in_form, forms) if not one.at_bound]


def _grouped_as(form: Effect, like: Effect) -> Effect:
    """Return a form whose numbers have the grouping of the known form's."""
    scopes = {p.name: p.scope for p in like.parameters}
    first = like.parameters[0].scope
    parameters = tuple(
        dataclasses.replace(p, scope=scopes.get(p.name, first if at == 0 else "rig"))
        for at, p in enumerate(form.parameters)
    )
    return dataclasses.replace(form, parameters=parameters, only=like.only)


def _starts(form: Effect, found: Refit) -> list[tuple[float, ...]]:
    """Return coordinates to begin at: as fitted, or in other valleys; else the form's usual."""
    top = max(s.window.peak for s in found.problem.shots)
    lists = []
    for parameter in form.parameters:
        shared = fitted_coordinate(found, parameter.name)
        usual = [top * s for s in parameter.peak_starts] or list(parameter.starts)
        if shared is not None:
            like = next(p for p in found.effect.parameters if p.name == parameter.name)
            value = parameter.value(shared) * parameter.ratio_to_entry / like.ratio_to_entry
            lists.append([parameter.coordinate(value * v) for v in (1.0, *parameter.valleys)])
        elif parameter.threshold:
            low, high = math.log(parameter.low), math.log(max(usual))
            dense = np.exp(np.linspace(low, high, FINER * len(usual)))
            lists.append([parameter.coordinate(float(v)) for v in dense])
        else:
            lists.append([parameter.coordinate(v) for v in usual])
    return list(product(*lists))


def _in_form(form: Effect, problem: JointProblem, base: joint.Fitted, found: Refit) -> Refit:
    """Return the refit in another form, from the cheapest starts beside the known form's best.

    What the known form cannot say it has bent everything else to say: where that leads nowhere,
    the other form begins once more from where everything was without either.
    """
    larger, before, plain = extended(problem, base, form, {})
    known = dict(zip(found.problem.names, found.fitted.theta, strict=True))
    beside = np.array([known.get(n, v) for n, v in zip(larger.names, before, strict=True)])
    bent = carried_over(found.problem.model, larger.model, found.fitted.nuisances)
    best: joint.Fitted | None = None
    for rest, nuisances in ((beside, bent), (before, plain)):
        if best is None or best.cost >= found.fitted.cost:
            here = _cheapest(larger, form, found, rest, nuisances)
            best = min((b for b in (best, here) if b is not None), key=_cost, default=None)
    if best is None:
        return found
    other = dataclasses.replace(found, effect=form, problem=larger, fitted=best)
    return refitted(other, problem, base)


def _cost(fitted: joint.Fitted) -> float:
    return fitted.cost


def _cheapest(
    larger: JointProblem,
    form: Effect,
    found: Refit,
    rest: NDArray[np.float64],
    nuisances: NDArray[np.float64],
) -> joint.Fitted | None:
    """Return the best of the fits from the cheapest starts, all but the form's numbers given."""
    neutral = _neutral_groups(found)
    ways: list[tuple[float, int, NDArray[np.float64]]] = []
    for start in _starts(form, found):
        theta = rest.copy()
        for parameter, value in zip(form.parameters, start, strict=True):
            for j, name in enumerate(larger.names):
                if name.is_of(form.id, parameter.name):
                    theta[j] = 0.0 if name.group in neutral and parameter.form != "log" else value
        ways.append((joint.total_cost(larger, theta, nuisances), len(ways), theta))
    fits = [
        joint.fit_to_compare(larger, nuisances, theta=theta, max_iterations=STEPS_FROM_NEAR)
        for cost, _, theta in sorted(ways)[:STARTS_FITTED]
        if math.isfinite(cost)
    ]
    return min(fits, key=_cost, default=None)


def _neutral_groups(found: Refit) -> set[str]:
    """Return the groups on whom the known form hardly acts."""
    parameter = found.effect.parameters[0]
    sizes = {
        n.group: abs(float(v))
        for n, v in zip(found.problem.names, found.fitted.theta, strict=True)
        if n.is_of(found.effect.id, parameter.name)
    }
    most = max(sizes.values(), default=0.0)
    return {group for group, size in sizes.items() if group and size < HARDLY * most}
