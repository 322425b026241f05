"""The end point of a step: straight in coordinates in which the problem is nearly linear."""

from __future__ import annotations

import math

import numpy as np

from analysis.aliases import Array
from analysis.fit.problem import JointProblem
from analysis.parameters import CRYSTAL, DAMPING, FREQUENCY, ParameterName

STRAIGHT_UP_TO = 0.5
"""Share by which 1/E' may fall in one straight step."""
_BEYOND = -math.log1p(-STRAIGHT_UP_TO) - STRAIGHT_UP_TO


def _loading(problem: JointProblem, theta: Array) -> tuple[float, Array]:
    r"""Return how far a coupon lowers the ring of the cell, and the derivative by the globals.

    .. math:: \ln(\omega_m / \omega_0) = \ln(\zeta_m / \zeta) = \tfrac12 \ln(M / (M + m))

    with the mean m of the shots' coupons. The problem has a crystal's mass among its globals.
    """
    slope = np.zeros(theta.size)
    at = problem.names.index(CRYSTAL)
    riding = 0.0
    for item in problem.shots:
        here = problem.item_at(item, theta).frame.coupon_on_crystal_kg / len(problem.shots)
        riding += here
        for j, one in problem.inputs_of(item):
            if one.kind == "coupon_mass":
                slope[j] -= here
    if riding == 0.0:
        return 0.0, np.zeros(theta.size)
    # by logarithms: a step may ask for a crystal's mass that no double holds
    whole = float(np.logaddexp(theta[at], math.log(riding)))
    slope[at] = riding
    return 0.5 * (float(theta[at]) - whole), 0.5 * slope * math.exp(-whole)


def along(problem: JointProblem, theta: Array, step: Array) -> Array:
    """Return the globals after a step: straight in 1/E', and in the ring of the loaded cell.

    What a network of pairs leaves open is a straight line in the compliances and a bent one in
    their logarithms. Drops on one coupon leave open how the mass that rings is shared between
    crystal and coupon, and fix the ring to some millionths: a line that is straight in the loaded
    cell's frequency and damping, and bent in those of the bare one. Along bent lines a fit creeps.
    """
    moved = theta + step
    for j, name in enumerate(problem.names):
        if name.is_modulus:
            d = float(step[j])
            # 1/E' must stay positive: beyond half way down it goes on like the logarithm
            ahead = -math.log1p(-d) if d < STRAIGHT_UP_TO else d + _BEYOND
            moved[j] = theta[j] + ahead
    ring = problem.positions([FREQUENCY, DAMPING, CRYSTAL])
    if ring is not None and problem.model.closed and problem.is_thinkable(moved):
        before, slope = _loading(problem, theta)
        after, _ = _loading(problem, moved)
        moved[ring[:2]] += float(slope @ step) - (after - before)
    return moved


def step_towards(name: ParameterName, distance: float) -> float:
    """Return the step of one global after which `along` has moved it by a distance.

    The distance is one of a logarithm or a coordinate.
    """
    if not name.is_modulus:
        return distance
    step = -math.expm1(-distance)
    return step if step < STRAIGHT_UP_TO else distance - _BEYOND
