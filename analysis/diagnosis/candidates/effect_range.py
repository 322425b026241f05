"""Are an effect's fitted numbers such as that effect can have?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.candidates.before_trigger import is_there_before
from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.effect import Effect
from analysis.fit import joint
from analysis.fit.physical_range import effect_out_of_range
from analysis.fit.problem import JointProblem

Array = NDArray[np.float64]


def _alike(sizes: Array, groups: Sequence[float | None]) -> bool:
    """Tell whether the shots of a group have much of a signal in common."""
    members = [[at for at, g in enumerate(groups) if g == one] for one in set(groups)]
    if len(sizes) < CRITERIA.free_signal.fewest_phases * len(members):
        return False
    common = sum(len(own) * float((sizes[own].mean(axis=0) ** 2).sum()) for own in members)
    return common > CRITERIA.free_signal.common_phase_share * max(float((sizes**2).sum()), 1e-300)


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
        A number outside its bounds, see `analysis.fit.physical_range`; or a free signal that is
        alike in all shots, or in those of a height, or absent before the trigger: the mains know
        neither when a sphere falls nor when it was let go.
    """
    if effect.basis is not None:
        first = problem.model.nuisances.index(f"{effect.id}.basis0")
        sizes = fitted.nuisances[:, first : first + effect.basis_size]
        heights = [shot.shot.drop_height_m for shot in problem.shots]
        locked = _alike(sizes, [None] * len(sizes)) or _alike(sizes, heights)
        return locked or not is_there_before(problem.shots, effect, sizes)
    return any(effect_out_of_range(problem, fitted, effect))
