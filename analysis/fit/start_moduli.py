"""The moduli a fit starts from: the stated ones, or those of the records."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from analysis.fit import joint
from analysis.fit.problem import JointProblem

WEAKLY_STATED_U = 0.3
"""A modulus stated with a larger u of its logarithm is started from the records."""
SCAN_U = 0.1
"""How well a scan of contact times knows ln K: its steps are 0.16 apart."""
CLOSE_STIFFNESS = 0.5
"""Stated moduli whose ln K is nearer than this to the records' are a good start as they are."""
MODULUS_STEPS = 12
TRIAL_STEPS = 10
"""Steps from either start, where the two differ, before the deeper one is taken."""


def start_moduli(
    problem: JointProblem, stiffness: NDArray[np.float64], start: NDArray[np.float64]
) -> None:
    """Give every modulus its prior mean, or what the pairs leave for it.

    A modulus stated within a factor or worse is no start: what the records say is better.
    ``stiffness`` is ln K of each shot from its record; the globals ``start`` are filled in.
    """
    inverse: dict[str, float] = {}
    for j, name in enumerate(problem.names):
        known = problem.prior_precision[j, j] > WEAKLY_STATED_U**-2
        if name.is_modulus and known:
            inverse[name] = math.exp(-problem.prior_mean[j])
    unknown = [n for n in problem.names if n.is_modulus and n not in inverse]
    for _ in range(2):  # the second round uses what the first one found
        for name in unknown:
            left = []
            for item, log_k in zip(problem.shots, stiffness, strict=True):
                keys = problem.material_keys(item)
                if keys is None or name not in keys or item.radius_m is None:
                    continue
                total = 4 / 3 * math.sqrt(item.radius_m) / math.exp(log_k)
                other = keys[0] if keys[1] == name else keys[1]
                rest = inverse.get(other, 0.5 * total)
                left.append(max(total - rest, 0.1 * total))
            inverse[name] = float(np.median(left))
    for j, name in enumerate(problem.names):
        if name in inverse:
            start[j] = -math.log(inverse[name])


def _moduli_by_records(
    problem: JointProblem, stiffness: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return globals whose moduli fit the records' stiffnesses; None where the start's do already.

    Stated moduli weigh by their uncertainty, the records by what a scan is worth, so that a
    material stated wrong by a factor cannot hold the others' start.
    """
    theta = problem.start.copy()
    at = [j for j, n in enumerate(problem.names) if n.is_modulus]
    rows = [i for i, s in enumerate(problem.shots) if problem.material_keys(s) is not None]
    if not at or not rows:
        return None
    prior = problem.prior_precision[np.ix_(at, at)]

    def linear(point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = [problem.shared_local(problem.shots[i], point) for i in rows]
        off = np.array([stiffness[i] - f[0][0] for i, f in zip(rows, found, strict=True)])
        return off, np.array([f[1][0, at] for f in found])

    off, _ = linear(theta)
    by_pair: dict[str, list[float]] = {}
    for i, one in zip(rows, off, strict=True):
        by_pair.setdefault(problem.shots[i].pair, []).append(float(one))
    # of one shot among several of its pair the label may be wrong, or it hit off-centre
    if max(abs(float(np.median(own))) for own in by_pair.values()) < CLOSE_STIFFNESS:
        return None
    for _ in range(MODULUS_STEPS):
        off, slope = linear(theta)
        matrix = prior + slope.T @ slope / SCAN_U**2
        pull = prior @ (problem.prior_mean[at] - theta[at]) + slope.T @ off / SCAN_U**2
        step = np.linalg.solve(matrix + np.eye(len(at)), pull)
        theta[at] += np.clip(step, -1.0, 1.0)
    return theta


def choose_start(
    problem: JointProblem, stiffness: NDArray[np.float64], nuisances: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Take the moduli of the records where a few steps lead deeper than from the stated ones.

    ``stiffness`` is ln K of each shot from its record. Return the globals to start from, and the
    shots' own parameters there, shape (shots, 4), as ``nuisances``.
    """
    other = _moduli_by_records(problem, stiffness)
    if other is None:
        return problem.start, nuisances
    stated = joint.fit(problem, nuisances, max_iterations=TRIAL_STEPS)
    seen = joint.fit(problem, nuisances, theta=other, max_iterations=TRIAL_STEPS)
    best = seen if seen.cost < stated.cost else stated
    return (problem.start, nuisances) if best.failed else (best.theta, best.nuisances)
