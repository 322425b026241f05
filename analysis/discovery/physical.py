"""Are an effect's fitted numbers such as that effect can have?"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.discovery.before_trigger import is_there_before
from analysis.effects.effect import Effect, EffectParameter
from analysis.fit import joint
from analysis.fit.problem import JointProblem

Array = NDArray[np.float64]

HARDLY = 0.05
"""Share of the largest owner's amplitude below which another's is as good as neutral."""
ALIKE, FEWEST_PHASES = 0.4, 6
"""Share of a free signal's power that shots have in common, from which its phase is not free; the
inverse of their number is what chance leaves."""


def _value(parameter: EffectParameter, coordinate: float) -> float:
    """Return the physical value, also where only an infinite uncertainty leads to it."""
    try:
        return parameter.value(coordinate)
    except OverflowError:
        return math.inf


def _alike(sizes: Array, groups: Sequence[float | None]) -> bool:
    """Tell whether the shots of a group have much of a signal in common."""
    members = [[at for at, g in enumerate(groups) if g == one] for one in set(groups)]
    if len(sizes) < FEWEST_PHASES * len(members):
        return False
    common = sum(len(own) * float((sizes[own].mean(axis=0) ** 2).sum()) for own in members)
    return common > ALIKE * max(float((sizes**2).sum()), 1e-300)


def left_its_range(problem: JointProblem, fitted: joint.Fitted, effect: Effect) -> bool:
    """Tell whether an effect's numbers are such as no such effect can have.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        A fit that has the effect.
    effect : Effect
        Which one.

    Returns
    -------
    bool
        A number outside its bounds by more than two standard uncertainties; or a free signal that
        is alike in all shots, or in those of a height, or absent before the trigger: the mains know
        neither when a sphere falls nor when it was let go.
    """
    if effect.basis is not None:
        first = problem.model.nuisances.index(f"{effect.id}.basis0")
        sizes = fitted.nuisances[:, first : first + effect.basis_size]
        heights = [shot.shot.drop_height_m for shot in problem.shots]
        locked = _alike(sizes, [None] * len(sizes)) or _alike(sizes, heights)
        return locked or not is_there_before(problem.shots, effect, sizes)
    u = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    for parameter in effect.parameters:
        if parameter.scope == "shot":
            own = problem.model.nuisances.index(f"{effect.id}.{parameter.name}")
            felt = [effect.acts_on(s.shot.sphere, s.shot.surface) for s in problem.shots]
            typical = parameter.value(float(np.median(fitted.nuisances[felt, own])))
            if not parameter.low <= typical <= parameter.high:
                return True
            continue
        places = [
            j
            for j, name in enumerate(problem.names)
            if name.split("[", 1)[0] == f"{effect.id}.{parameter.name}"
        ]
        largest = float(np.abs(fitted.theta[places]).max(initial=0.0))
        for j in places:
            at = float(fitted.theta[j])
            width = 0.0 if parameter.resolved else 2.0 * float(u[j])
            if parameter.form != "log" and abs(at) < HARDLY * largest:
                continue  # next to another owner's it is neutral
            nearest = [_value(parameter, c) for c in (at - width, at, at + width)]
            if parameter.form == "inverse" and at - width <= 0.0 <= at + width:
                continue  # neutral is within reach
            if not any(parameter.low <= v <= parameter.high for v in nearest):
                return True
    return False
