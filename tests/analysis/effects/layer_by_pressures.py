"""A sphere on a bonded elastic layer, solved for its pressure: the reference of the thin coupon.

The pressure is a sum of ``c_k (a^2 - r^2)^(k + 1/2)``, whose Hankel transforms are Bessel
functions; the coefficients make the surface follow the sphere at many radii. The layer's compliance
by wave number is that of Alexandrov & Pozharskii, Three-Dimensional Contact Problems (2001),
``(2 q sinh 2x - 4x) / (2 q cosh 2x + 4 x^2 + 1 + q^2)``, q = 3 - 4 nu.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma, hyp2f1, jv

Array = NDArray[np.float64]
TERMS = 10
WAVES = 240


def compliance_less_one(x: Array, poissons_ratio: float) -> Array:
    """Return the layer's compliance over a half-space's, less 1; x is wave number by thickness."""
    q, small = 3 - 4 * poissons_ratio, np.exp(-2 * x)
    above = q * (1 - small**2) - 4 * x * small
    below = q * (1 + small**2) + (4 * x**2 + 1 + q**2) * small
    return np.asarray(above / below - 1)


def contact(a_over_h: float, poissons_ratio: float, coupon_share: float) -> tuple[float, float]:
    """Return ``sqrt(R delta)/h`` and the force over Hertz's at the same indentation.

    ``coupon_share`` is the layer's part in the compliance of thick bodies, 1 for a rigid sphere.
    """
    order = np.arange(TERMS) + 1.5
    r = np.cos(np.pi * (np.arange(2 * TERMS) + 0.5) / (4 * TERMS))[:, None]
    size = 2.0 ** (order - 1) * gamma(order)
    # lengths in units of a, E* = 1: the half-space by Weber & Schafheitlin's integral
    thick = size * math.sqrt(math.pi) / (2.0**order * gamma(order + 0.5))
    thick = thick * hyp2f1(0.5, 0.5 - order, 1.0, r**2)
    nodes, weights = np.polynomial.legendre.leggauss(WAVES)
    x = 15 * (nodes + 1)
    less = 15 * weights * a_over_h * compliance_less_one(x, poissons_ratio)
    wave = a_over_h * x[:, None]
    thin = (jv(0, r * wave.T) * less) @ (size * wave**-order * jv(order, wave))
    system = np.hstack([2 * (thick + coupon_share * thin), -np.ones_like(r)])
    found, *_ = np.linalg.lstsq(system, -0.5 * r[:, 0] ** 2, rcond=None)
    depth, force = float(found[-1]), float(math.pi * (found[:-1] / order).sum())
    return math.sqrt(depth) * a_over_h, force / (4 / 3 * depth**1.5)
