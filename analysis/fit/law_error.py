"""The error of an effect's law, as inputs of a joint fit.

Like a mass that was weighed, a law is stated and uncertain: each coefficient of its discrepancy is
a global that was stated as 0, with a standard uncertainty, and adds a signal to some shots.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.aliases import Array
from analysis.fit.fit_shot import FitShot
from analysis.fit.inputs import Input
from analysis.fit.priors import Prior
from analysis.fit.problem import JointProblem

KIND = "law"


@dataclass(frozen=True)
class LawError(Input):
    """One coefficient of the discrepancy of one law.

    Attributes
    ----------
    added : mapping of float to ndarray of shape (n,)
        What a coefficient of 1 adds to each shot that has it, by the shot's place in the campaign.
        [unit of the signal]
    faster : mapping of float to float
        What it adds to the promised ln v0.
    """

    added: Mapping[float, Array] = field(default_factory=dict)
    faster: Mapping[float, float] = field(default_factory=dict)

    @property
    def scale(self) -> float:
        """Return the coordinate's change per unit of ``value``."""
        return 1.0

    @property
    def stated(self) -> float:
        """Return the coordinate of a law that is exact."""
        return 0.0

    def value_at(self, coordinate: float) -> float:
        """Return the coefficient."""
        return coordinate

    def belongs_to(self, item: FitShot) -> bool:
        """Tell whether it adds something to this shot."""
        return item.frame.place in self.added

    def moved(self, item: FitShot, by: float) -> FitShot:
        """Return a shot with so much of it taken off the record."""
        if by == 0.0 or not self.belongs_to(item):
            return item
        place, speed = item.frame.place, item.speed_prior
        window = replace(item.window, signal=item.window.signal - by * self.added[place])
        if speed is not None:
            speed = Prior(speed.mean + by * self.faster[place], speed.u)
        return replace(item, window=window, speed_prior=speed)

    def signal(self, item: FitShot) -> Array | None:
        """Return what it adds to a shot's record per unit."""
        return self.added[item.frame.place]


def with_law_errors(problem: JointProblem, errors: Sequence[LawError]) -> JointProblem:
    """Return a problem in which laws are inexact.

    Parameters
    ----------
    problem : JointProblem
        Its inputs, if any, are the last globals.

    Returns
    -------
    JointProblem
        With these behind all globals.
    """
    size, more = len(problem.names), len(errors)
    precision = np.zeros((size + more, size + more))
    precision[:size, :size] = problem.prior_precision
    precision[range(size, size + more), range(size, size + more)] = [e.u**-2 for e in errors]
    return replace(
        problem,
        names=[*problem.names, *(e.name for e in errors)],
        start=np.concatenate([problem.start, np.zeros(more)]),
        prior_mean=np.concatenate([problem.prior_mean, np.zeros(more)]),
        prior_precision=precision,
        inputs=(*problem.inputs, *errors),
    )
