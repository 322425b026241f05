"""Tests of the network of moduli: does it hold together, which pair contradicts."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq

from analysis.moduli_network import (
    System,
    chi2,
    errors_of_rows,
    grouped,
    information,
    linearise,
    solve,
)
from analysis.moduli_result import NETWORK_P, Network, PairCheck, contradiction_limit

LARGEST_DARK_U = 2.0
"""A between-recording uncertainty of ln E* beyond this is no measurement any more."""


def pair_checks(system: System) -> tuple[PairCheck, ...]:
    """Return how each pair's observations agree with all the rest.

    In the order of first appearance. The residuals' covariance is that of the observations less
    that of their adjusted values; a pair that nothing else controls has none left and no score.
    """
    groups = grouped(system)
    x, covariance = solve(system, groups)
    r, design = linearise(system, groups, x)
    n = len(system.names)
    calibrations = np.linalg.inv(system.precision[n:, n:])
    # without the pair's own part, which is the same in all its observations
    free = system.observed - errors_of_rows(system, x)
    found = []
    for number, (sphere, surface) in enumerate(system.pairs):
        mine = system.group_pair == number
        weight = float(groups.weight[mine].sum())
        share = groups.weight[mine] / weight
        mean_design = share @ design[mine]
        own = 1 / weight
        left = own - float(mean_design @ covariance @ mean_design)
        # the calibration's error is the same in every shot of the pair: no mean takes it away
        together = share @ groups.common[mine]
        common = float(together @ calibrations @ together)
        residual = float(share @ r[mine])
        log = float(share @ groups.observed[mine])
        rows = system.pair == number
        mean_free = float(system.weight[rows] @ free[rows]) / weight
        found.append(
            PairCheck(
                sphere=sphere,
                surface=surface,
                observations=int(rows.sum()),
                log_observed=log,
                log_adjusted=log - residual,
                u_observed=math.sqrt(own + common),
                score=residual / math.sqrt(left) if left > 1e-6 * own else None,
                scatter_chi2=float(system.weight[rows] @ (free[rows] - mean_free) ** 2),
            )
        )
    return tuple(found)


def consistency(system: System) -> Network:
    """Return chi2 of observations, references and calibrations, and its degrees of freedom.

    The weak prior of an unknown modulus is no observation.
    """
    groups = grouped(system)
    x, covariance = solve(system, groups)
    stated = system.precision.copy()
    for j, prior in enumerate(system.priors):
        if prior is None:
            stated[j, j] = 0.0  # the weak prior of an unknown is no observation
    _, design = linearise(system, groups, x)
    fitted = float(np.trace(covariance @ information(system, groups, design, stated)))
    references = sum(p is not None for p in system.priors)
    count = system.observed.size + references + groups.slope.size
    return Network(chi2(system, groups, x, stated), max(round(count - fitted), 0))


def anchored(system: System) -> list[bool]:
    """Tell which materials hang together with a reference through dropped pairs."""
    reached = [p is not None for p in system.priors]
    for _ in system.names:
        for a, b in zip(system.left, system.right, strict=True):
            reached[a] = reached[b] = reached[a] or reached[b]
    return reached


def _without(system: System, pairs: Sequence[str]) -> System:
    """Return the system with next to no weight on these pairs' observations."""
    out = np.array([f"{sphere}/{surface}" in pairs for sphere, surface in system.pairs])
    weight = np.where(out[system.pair], system.weight * 1e-12, system.weight)
    return dataclasses.replace(system, weight=weight)


def snoop(system: System) -> tuple[tuple[PairCheck, ...], tuple[str, ...]]:
    """Return each pair's check and the pairs that contradict the rest, worst first.

    A contradicting pair's score is the one it was set aside with. Source: W. Baarda's data snooping
    (1968): the worst pair is set aside and the rest judged again, so that one bad pair does not
    make its sound neighbours look bad.
    """
    aside: dict[str, PairCheck] = {}
    while True:
        current = _without(system, list(aside))
        checks = pair_checks(current)
        scored = [c for c in checks if c.score is not None and c.pair not in aside]
        worst = max(scored, key=lambda c: abs(c.score or 0.0), default=None)
        limit = contradiction_limit(len(checks))
        if worst is None or abs(worst.score or 0.0) <= limit:
            return tuple(aside.get(c.pair, c) for c in checks), tuple(aside)
        aside[worst.pair] = worst


def with_dark_uncertainty(system: System) -> tuple[System, float]:
    """Return the system with the uncertainty per recording that makes it consistent.

    With it what was added to each u(ln E*) in quadrature; 0 where nothing was. Source: Mandel &
    Paule (1970). Added, not multiplied: where models fail, the recordings with the smallest noise
    are no better than others. The references' stated moduli are left as they are.
    """

    def wider(dark_u: float) -> System:
        """Return the system with so much added to every recording."""
        return dataclasses.replace(system, weight=1 / (1 / system.weight + dark_u**2))

    def excess(log_dark_u: float) -> float:
        """Return chi2 beyond its expectation."""
        found = consistency(wider(math.exp(log_dark_u)))
        return found.chi2 - found.degrees_of_freedom

    p = consistency(system).p_value
    if p is None or p >= NETWORK_P:
        return system, 0.0
    low, high = math.log(1e-6), math.log(LARGEST_DARK_U)
    if excess(high) >= 0:
        return wider(LARGEST_DARK_U), LARGEST_DARK_U
    dark_u = math.exp(float(brentq(excess, low, high, xtol=1e-3))) if excess(low) > 0 else 1e-6
    return wider(dark_u), dark_u
