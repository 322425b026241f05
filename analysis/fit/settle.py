"""A fit of each shot's own parameters with all shared ones fixed."""

from __future__ import annotations

import numpy as np

from analysis.aliases import Array
from analysis.fit.blocks import linearise_shot
from analysis.fit.over_shots import for_each_shot
from analysis.fit.problem import JointProblem

SETTLE_STEPS = 8
"""At most: what follows is a fit of everything, which goes on from wherever this ends."""
SETTLED_SHARE = 1e-3
"""A shot's own parameters are good enough to start from when a step gains less than this share of
its squares. Chosen by trial; a fit of everything follows in any case."""


def settle(
    problem: JointProblem,
    theta: Array,
    nuisances: Array,
    *,
    kept: tuple[str, ...] = (),
    steps: int = SETTLE_STEPS,
) -> Array:
    """Return the shots' own parameters at their best for given globals, each shot by itself.

    ``nuisances``, shape (shots, p), are where to start. The result is never worse, and a shot that
    starts far off does not hold the others up. The nuisances named in ``kept`` stay where they are:
    what is known before a record is a better guide than a model that is far from it.
    """
    free = np.array([name not in kept for name in problem.model.nuisances])

    def settled(row: int) -> Array:
        """Return one shot's own parameters at their best."""
        own: Array = nuisances[row].copy()
        damping = 1e-3
        block = linearise_shot(problem, problem.shots[row], theta, own, own=True)
        for _ in range(steps):
            if block is None:
                break
            inner = block.matrix.copy()
            inner[np.diag_indices_from(inner)] *= 1 + damping
            step = np.zeros(free.size)
            try:
                step[free] = np.linalg.solve(inner[np.ix_(free, free)], block.vector[free])
            except np.linalg.LinAlgError:
                break  # the shot says nothing of its own parameters from here
            ahead = linearise_shot(problem, problem.shots[row], theta, own + step, own=True)
            if ahead is None or not ahead.cost < block.cost:
                damping *= 30
                continue
            small = block.cost - ahead.cost < SETTLED_SHARE * block.cost
            own, block, damping = own + step, ahead, damping / 10
            if small:
                break
        return own

    compiled = any(e.in_solver for e in problem.model.effects)
    found = for_each_shot(settled, len(problem.shots), on_all_cores=compiled)
    return np.array(found).reshape(nuisances.shape)
