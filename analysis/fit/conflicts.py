"""Statements that contradict the shots: found one by one, named, and left out for a check."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array, Json
from analysis.campaign import Quantity
from analysis.fit import joint
from analysis.fit.inputs import AIR_RESISTANCE, LAW
from analysis.fit.joint import Fitted
from analysis.fit.priors import UNKNOWN_LOG_U
from analysis.fit.problem import JointProblem
from analysis.fit.stated_effects import stated_effect, stated_effects
from analysis.parameters import ParameterName

CONFLICT_ABOVE = 3.3
"""Standard uncertainties of the difference; chance alone does it once in a thousand statements."""
LEAST_CONTROL = 1e-4
"""Share of a statement's variance that the shots must take off for them to contradict it at all."""
STABLE_BELOW = 2.0
"""A modulus that moves by less of its own u when a statement is left out does not rest on it."""
FIRST_STEPS = 12
"""Steps after which a fit without statements must be near the noise, or it is given up. What only a
wrong statement kept away from the shots comes near them as fast as any fit does, in 3 to 11 steps;
a model that lacks physics wandered on for more than 120. What is near then has twice as many to
end; what has not wanders, too."""


@dataclass(frozen=True)
class Conflict:
    """One statement that the shots, with all other statements, contradict."""

    name: ParameterName
    path: str
    """Where a campaign states it."""
    stated: Quantity
    found: Quantity
    """What everything else says. [``unit``]"""
    unit: str
    score: float
    """The difference over its own standard uncertainty."""

    @property
    def sentence(self) -> str:
        """Return what contradicts what, and what to look at."""
        kind, _, owner = self.path.partition(".")
        what, _, key = owner.rpartition(".")
        thing = f"{key.rpartition('_')[0].replace('_', ' ')} of {what}" if what else self.path
        if key.startswith("youngs"):
            thing = what
        scale, unit = (1e-9, "GPa") if self.unit == "Pa" else (1.0, self.unit)
        said, seen = f"{self.stated.value * scale:.3g}", f"{self.found.value * scale:.3g}"
        look = {
            "spheres": "check its label and certificate, and that this sphere was dropped",
            "surfaces": "check its label and certificate, and that this coupon was under test",
        }.get(kind, "measure it again")
        return (
            f"The stated {said} {unit} of {thing} is {abs(self.score):.0f} u from what the shots "
            f"and all other statements say ({seen} {unit}): {look}."
        )

    def to_json(self) -> Json:
        """Return the conflict as a fit's JSON has it."""
        return {
            "path": self.path,
            "stated": dataclasses.asdict(self.stated),
            "found": dataclasses.asdict(self.found),
            "unit": self.unit,
            "difference_in_u": self.score,
            "sentence": self.sentence,
        }


def _statements(problem: JointProblem) -> list[int]:
    """Return the globals that a campaign states and that shots can contradict."""
    found = []
    for j, name in enumerate(problem.names):
        if name.is_modulus and _stated_modulus(problem, name) is not None:
            found.append(j)
    found.extend(j for j, _ in stated_effects(problem))
    first = len(problem.names) - len(problem.inputs)
    # that a law is exact, or the air's drag, is no statement of the campaign's
    inputs = enumerate(problem.inputs, start=first)
    return [*found, *(j for j, one in inputs if one.kind not in (LAW, AIR_RESISTANCE))]


def _stated_modulus(problem: JointProblem, name: ParameterName) -> Quantity | None:
    """Return the Young's modulus that a campaign states of a material."""
    campaign = problem.campaign
    known = campaign.spheres if name.kind == "sphere" else campaign.surfaces
    return known[name.owner].youngs_modulus_pa


def _without(
    problem: JointProblem, theta: Array, information: Array, j: int
) -> tuple[Array, Array]:
    """Return globals and information, to first order, when one statement says next to nothing."""
    own = float(problem.prior_precision[j, j])
    less = own - UNKNOWN_LOG_U**-2
    after = information.copy()
    after[j, j] -= less
    pull = np.zeros(theta.size)
    pull[j] = less * (theta[j] - problem.prior_mean[j])
    return theta + np.linalg.solve(after, pull), after


def conflicts(problem: JointProblem, fitted: Fitted) -> list[Conflict]:
    """Return the statements that contradict the shots, worst first.

    After each one the rest is judged without it, so that it does not make its neighbours look bad.
    It ends where the shots seem to say what no float holds, as a model may that lacks much.
    Source: W. Baarda's data snooping (1968), as for the network of moduli. The difference of a
    statement and what everything else says has the variance of both. Where the shots do not reduce
    a statement's variance they cannot contradict it.
    """
    if fitted.failed:
        return []
    theta = fitted.theta
    information: Array = np.asarray(np.linalg.inv(fitted.covariance))
    candidates, found = _statements(problem), []
    while candidates:
        covariance = np.asarray(np.linalg.inv(information))
        scores = {j: _score(problem, theta, covariance, j) for j in candidates}
        worst = max(scores, key=lambda j: abs(scores[j]))
        if not abs(scores[worst]) > CONFLICT_ABOVE:
            break
        theta, information = _without(problem, theta, information, worst)
        u = math.sqrt(float(np.linalg.inv(information)[worst, worst]))
        try:
            found.append(_conflict(problem, worst, (float(theta[worst]), u), scores[worst]))
        except OverflowError:  # so far off that first order leads nowhere
            break
        candidates.remove(worst)
    return found


def _score(problem: JointProblem, theta: Array, covariance: Array, j: int) -> float:
    before = 1 / float(problem.prior_precision[j, j])
    left = before - float(covariance[j, j])
    if left < LEAST_CONTROL * before:
        return 0.0
    return float(theta[j] - problem.prior_mean[j]) / math.sqrt(left)


def _conflict(problem: JointProblem, j: int, seen: tuple[float, float], score: float) -> Conflict:
    name, (at, u) = problem.names[j], seen
    effect = stated_effect(problem, name)
    if effect is not None:
        parameter, said = effect.parameter, effect.uncertainty
        stated = Quantity(effect.value, said.u if said else 0.0)
        found = Quantity(parameter.value(at), u * abs(parameter.slope(at)))
        return Conflict(name, effect.path, stated, found, parameter.unit, score)
    if not name.is_modulus:
        one = problem.inputs[j - len(problem.names) + len(problem.inputs)]
        stated = Quantity(one.value, one.uncertainty.u)
        return Conflict(
            name, one.path, stated, Quantity(one.value_at(at), u / one.scale), one.unit, score
        )
    young = _stated_modulus(problem, name)
    assert young is not None
    # the same Poisson's ratio on both sides: its uncertainty is in the score already
    value = young.value * math.exp(at - float(problem.prior_mean[j]))
    path = f"{name.kind}s.{name.owner}.youngs_modulus_Pa"
    return Conflict(name, path, young, Quantity(value, u * value), "Pa", score)


def fit_without(
    problem: JointProblem, fitted: Fitted, found: list[Conflict], *, widened: float
) -> tuple[JointProblem, Fitted] | None:
    """Return the fit again with the conflicting statements ``found`` saying next to nothing.

    ``widened`` is the factor on the noise's variance in this fit. The result is None if there is no
    solution, or none near the shots: the model then misses something else, and what it says without
    the statements means nothing.
    """
    precision = problem.prior_precision.copy()
    for one in found:
        j = problem.names.index(one.name)
        precision[j, j] = UNKNOWN_LOG_U**-2
    wide = dataclasses.replace(problem, prior_precision=precision)
    first = joint.fit(wide, fitted.nuisances, theta=fitted.theta, max_iterations=FIRST_STEPS)
    if first.converged:
        return wide, first
    if first.failed or joint.is_hopeless(wide, first.cost, widened=widened):
        return None
    second = joint.fit(
        wide, first.nuisances, theta=first.theta, blocks=first.blocks,
        max_iterations=2 * FIRST_STEPS,
    )  # fmt: skip
    return (wide, second) if second.converged else None
