"""A smooth sphere on a rough elastic half-space, solved for its pressures ring by ring.

Greenwood & Tripp 1967 with exponential heights. Units: heights in sigma, radii in sqrt(R sigma),
pressures in E* sqrt(sigma/R); ``hardness`` is E* sqrt(sigma/R) / p_c.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import ellipe, ellipk

Array = NDArray[np.float64]
EDGES = np.linspace(0.0, 16.0, 161)
"""Far beyond where the pressure is: it falls like exp(-r^2/2) outside the contact."""
CENTRES = 0.5 * (EDGES[1:] + EDGES[:-1])
AREAS = math.pi * np.diff(EDGES**2)


def _sinks(r: Array, b: float) -> Array:
    """Return how a half-space sinks under a unit pressure on a disc of radius b."""
    found = np.zeros_like(r)
    inside = r <= b
    found[inside] = 4 * b / math.pi * ellipe((r[inside] / b) ** 2)
    k = (b / r[~inside]) ** 2
    found[~inside] = 4 * r[~inside] / math.pi * (ellipe(k) - (1 - k) * ellipk(k))
    return found


_DISCS = np.array([_sinks(CENTRES, b) if b else np.zeros_like(CENTRES) for b in EDGES]).T
RINGS = np.diff(_DISCS, axis=1)


def contact(depth: float, hardness: float) -> tuple[float, Array]:
    """Return the force over E* sqrt(R sigma) sigma, and the pressures, at an overlap in sigma."""
    gap = depth - 0.5 * CENTRES**2
    log = np.minimum(gap, math.log(hardness))  # of the pressure over p_c
    for _ in range(400):
        pressure = np.exp(log) / hardness
        system = np.eye(log.size) + RINGS * pressure
        step = np.linalg.solve(system, gap - log - RINGS @ pressure)
        log = log + step * min(1.0, 1.5 / np.abs(step).max())
        if np.abs(step).max() < 1e-10:
            break
    pressure = np.exp(log) / hardness
    return float(pressure @ AREAS), pressure
