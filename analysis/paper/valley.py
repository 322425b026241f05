"""Why one pair does not determine two moduli: the valley of the cost over E_p and E_s."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from analysis.aliases import Array
from analysis.fit.problem import FitShot
from analysis.paper.fits import Known, predict

SOLIDS_PA = 1e6, 1.3e12
"""Young's moduli that solids have, from soft rubber to diamond. [Pa]"""
SAME_COST = 1e-3
"""Squares by which fits that ended at the valley's bottom may differ."""


@dataclass(frozen=True)
class Valley:
    """How one shot of one pair sees two moduli."""

    sphere_pa: Array
    """Young's moduli of the grid, shape (n,). [Pa]"""
    surface_pa: Array
    """The same of the surface, shape (m,). [Pa]"""
    sphere_softness: float
    """``1 - nu^2``, as of the surface."""
    surface_softness: float
    excess_chi2: Array
    """Cost above its least, white noise. Shape (m, n). [1]"""
    correlation: float
    """Between ln E_p and ln E_s, from the Fisher information."""
    eigenvalue_ratio: float
    """Smaller over larger eigenvalue of the Fisher information; 0 but for rounding."""
    u_ln_reduced: float
    """Standard uncertainty of ln E* from the same information."""
    along: float
    across: float
    """Excess chi2 where E_p is doubled: with E_s making up for it (``along``), and without."""
    ends: tuple[tuple[float, ...], ...]
    """Start E_p and E_s, end E_p and E_s, end E*, excess chi2, of least-squares fits. [Pa; the last
    1]"""


def valley(
    item: FitShot,
    known: Known,
    *,
    sphere: tuple[float, float],
    surface: tuple[float, float],
    starts_pa: tuple[tuple[float, float], ...],
    noise_v: float,
) -> Valley:
    """Return the cost of one shot over E_p and E_s, its curvature, and where fits end.

    Everything but the two moduli is held fixed, which makes the valley narrower than it is.
    ``sphere`` and ``surface`` are literature (E [Pa], nu); ``starts_pa`` are (E_p, E_s) from which
    fits of both are started; ``noise_v`` is white.
    """
    softness = [1 - nu**2 for _, nu in (sphere, surface)]

    def reduced(logs: Array) -> float:
        """Return E* of (ln E_p, ln E_s)."""
        return 1 / sum(s / math.exp(ln) for s, ln in zip(softness, logs, strict=True))

    def residual(logs: Array) -> Array:
        """Return measurement minus model, in units of the noise."""
        return (item.window.signal - predict(item, known, reduced(logs))) / noise_v

    def chi2(logs: Array) -> float:
        """Return the squares of the residual."""
        return float(np.sum(residual(logs) ** 2))

    ends = []
    for start in starts_pa:
        found = least_squares(
            residual,
            np.log(start),
            # a wild first step otherwise ends where no slope is left
            bounds=(math.log(SOLIDS_PA[0]), math.log(SOLIDS_PA[1])),
            x_scale=1.0,
            xtol=1e-13,
            ftol=1e-13,
            gtol=1e-8,
            max_nfev=200,
        )
        ends.append((start, found.x, 2 * float(found.cost)))
    least = min(cost for _, _, cost in ends)
    # along the valley costs differ by rounding, also where one modulus has gone to infinity
    best = next(x for _, x, cost in ends if cost - least < SAME_COST)

    step = 1e-4
    columns = [
        (residual(best + step * one) - residual(best - step * one)) / (2 * step)
        for one in np.eye(2)
    ]
    jacobian = np.stack(columns, axis=1)
    fisher = jacobian.T @ jacobian
    values = np.linalg.eigvalsh(fisher)
    shares = np.array([s / math.exp(ln) for s, ln in zip(softness, best, strict=True)])
    shares *= reduced(best)
    # d ln E* = shares . d ln E, so the information on ln E* is the large eigenvalue over |shares|^2
    information = float(values[-1]) / float(shares @ shares)

    doubled = best[0] + math.log(2)
    rest = 1 / reduced(best) - softness[0] / math.exp(doubled)
    grid = np.geomspace(0.6e9, 30e9, 121)
    moduli = np.geomspace(0.2e9, 20e9, 600)
    profile = np.array(
        [np.sum((item.window.signal - predict(item, known, e)) ** 2) for e in moduli]
    )
    on_grid = 1 / (softness[0] / grid[None, :] + softness[1] / grid[:, None])
    excess = np.interp(np.log(on_grid), np.log(moduli), profile / noise_v**2 - least)
    return Valley(
        sphere_pa=grid,
        surface_pa=grid,
        sphere_softness=softness[0],
        surface_softness=softness[1],
        excess_chi2=excess,
        correlation=-float(fisher[0, 1] / math.sqrt(fisher[0, 0] * fisher[1, 1])),
        eigenvalue_ratio=float(values[0] / values[-1]),
        u_ln_reduced=information**-0.5,
        along=chi2(np.array([doubled, math.log(softness[1] / rest)])) - chi2(best),
        across=chi2(np.array([doubled, best[1]])) - chi2(best),
        ends=tuple(
            (*start, *map(float, np.exp(x)), reduced(x), cost - least) for start, x, cost in ends
        ),
    )
