"""Stated numbers that belong to an effect, such as a coupon's thickness."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analysis.campaign import Uncertainty
from analysis.effects.effect import EffectParameter
from analysis.fit.priors import LEAST_RELATIVE_U, Prior
from analysis.parameters import ParameterName

if TYPE_CHECKING:
    from analysis.fit.problem import JointProblem


@dataclass(frozen=True)
class StatedEffect:
    """A stated number that is an effect's own."""

    parameter: EffectParameter
    path: str
    """Where a campaign states it."""
    label: str
    value: float
    """As stated. [``parameter.unit``]"""
    uncertainty: Uncertainty | None
    """Of ``value``; None where it counts as exact."""

    @property
    def prior(self) -> Prior:
        """Return what is known of the effect's coordinate."""
        at = self.parameter.coordinate(self.value)
        u = self.uncertainty.u if self.uncertainty else 0.0
        u = max(u, LEAST_RELATIVE_U * self.value)
        return Prior(at, u / abs(self.parameter.slope(at)))


def _parameter(problem: JointProblem, name: ParameterName) -> tuple[int, EffectParameter] | None:
    """Return an effect's number by its global's name, with its row among the local parameters."""
    for row, (effect, p) in problem.model.number_at.items():
        is_known = p.stated or p.exact is not None or math.isfinite(p.usual_u)
        if is_known and name.is_of(effect.id, p.name):
            return row, p
    return None


def stated_effect(problem: JointProblem, name: ParameterName) -> StatedEffect | None:
    """Return what is stated of an effect's number.

    None if nothing is stated, or not the same of all the surfaces that share the number.
    """
    found = _parameter(problem, name)
    if found is None:
        return None
    row, parameter = found
    if not parameter.stated:
        return None
    owners = {s.shot.surface for s in problem.shots if problem.effect_key(row, s) == name}
    said = set()
    for owner in owners:
        surface = problem.campaign.surfaces.get(owner or "")
        value = getattr(surface, parameter.stated, None)
        if value is None:
            return None
        said.add((float(value), getattr(surface, f"u_{parameter.stated}")))
    if len(said) != 1:
        return None
    (value, uncertainty), first = said.pop(), min(str(o) for o in owners)
    words = parameter.stated.rpartition("_")[0].replace("coupon_", "").replace("_", " ")
    path = f"surfaces.{first}.{parameter.stated}"
    label = f"{words} of the coupon {', '.join(sorted(str(o) for o in owners))}"
    return StatedEffect(parameter, path, label, value, uncertainty)


def effect_prior(problem: JointProblem, name: ParameterName) -> Prior | None:
    """Return what is known of an effect's global beforehand.

    As it is stated, as the law itself gives it, or as rigs are built.

    None if nothing is known, and for what is not an effect's.
    """
    found = _parameter(problem, name)
    if found is None:
        return None
    stated = stated_effect(problem, name)
    if stated is not None:
        return stated.prior
    parameter = found[1]
    if parameter.exact is not None:
        return Prior(parameter.coordinate(parameter.exact), LEAST_RELATIVE_U)
    return Prior(0.0, parameter.usual_u) if math.isfinite(parameter.usual_u) else None


def stated_effects(problem: JointProblem) -> list[tuple[int, StatedEffect]]:
    """Return all such numbers of a problem, with their places among the globals."""
    found = ((j, stated_effect(problem, name)) for j, name in enumerate(problem.names))
    return [(j, one) for j, one in found if one is not None]
