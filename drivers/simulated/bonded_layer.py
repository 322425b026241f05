"""The stiffening of a coupon of finite thickness, in three published forms.

All are factors on the coupon's plane-strain modulus alone: ``1/E* = 1/E1' + 1/(E2' f(X))`` with
``X = sqrt(R delta)/h``, written ``f = 1 + c1 X + ... + c6 X^6`` for the integrator.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

COEFFICIENTS = 8
_CONTACTS = 0.8 * (1.0 - np.cos(np.linspace(0.03, np.pi, 40)))
"""Radii of contact over thickness at which the layer is solved; the largest is X = 1.1 to 1.5. The
polynomial of order 8 through them is within 3e-5 of f (tested)."""
_POINTS = 32  # of the integral equation; doubling them moves f by less than 1e-9


def dimitriadis(poissons_ratio: float) -> Vector:
    """Return the coefficients of Dimitriadis et al., Biophys. J. 82 (2002) 2798, Eq. 10 and 11.

    The bonded layer, any Poisson's ratio, asymptotic for small X. Of the eight, those beyond the
    fourth are zero.
    """
    nu = poissons_ratio
    a = -(1.2876 - 1.4678 * nu + 1.3442 * nu**2) / (1.0 - nu)
    b = (0.6387 - 1.0277 * nu + 1.5164 * nu**2) / (1.0 - nu)
    pi = math.pi
    return np.array(
        [
            -2.0 * a / pi,
            4.0 * a**2 / pi**2,
            -8.0 / pi**3 * (a**3 + 4.0 * pi**2 * b / 15.0),
            16.0 * a / pi**4 * (a**3 + 3.0 * pi**2 * b / 5.0),
            *np.zeros(COEFFICIENTS - 4),
        ]
    )


def garcia() -> Vector:
    """Return the coefficients of P. D. Garcia & R. Garcia, Biophys. J. 114 (2018) 2923, nu = 0.5.

    1.133, 1.497, 1.469, 0.755 for the bonded layer and a sphere.
    """
    return np.array([1.133, 1.497, 1.469, 0.755, *np.zeros(COEFFICIENTS - 4)])


def solved_layer(poissons_ratio: float, coupon_share: float) -> Vector:
    """Return the eight coefficients fitted to a numerical solution of sphere on bonded layer.

    The sphere's own compliance is in the solution, so nothing is added up in series; ``f`` is then
    what the series formula needs in order to give the solved force. ``coupon_share`` is
    ``(1/E2') / (1/E1' + 1/E2')``, the coupon's part in the compliance of thick bodies.
    """
    return np.array(_solved_layer(round(poissons_ratio, 4), round(coupon_share, 3)))


@lru_cache(maxsize=64)
def _solved_layer(poissons_ratio: float, coupon_share: float) -> tuple[float, ...]:
    found = [layer_contact(a, poissons_ratio, coupon_share) for a in _CONTACTS]
    X = np.array([x for x, _ in found])
    whole = np.array([factor for _, factor in found])
    f = coupon_share / (1.0 / whole - (1.0 - coupon_share))
    powers = X[:, None] ** np.arange(1, COEFFICIENTS + 1)
    fitted, *_ = np.linalg.lstsq(powers / f[:, None], (f - 1.0) / f, rcond=None)
    return tuple(float(c) for c in fitted)


def layer_contact(
    contact_over_thickness: float, poissons_ratio: float, coupon_share: float
) -> tuple[float, float]:
    """Solve a frictionless sphere on a bonded layer for one radius of contact.

    Return ``X = sqrt(R delta)/h`` and the force over that of Hertz at the same approach.
    ``contact_over_thickness`` is a / h; ``coupon_share`` is the layer's part in the compliance of
    thick bodies, 1 for a rigid sphere.

    Pressure ``p^(k) = int_0^a phi(t) cos(k t) dt`` turns ``w(r) = delta - r^2/(2R)`` into

        phi(t) + (s/(pi h)) int_0^a phi(u) [G((t+u)/h) + G((t-u)/h)] du = E*/pi (delta - t^2/R),
        G(z) = int_0^inf (L(x) - 1) cos(x z) dx,
        L(x) = (q sinh x cosh x - x) / (q sinh^2 x + x^2 + 4 (1 - nu)^2),   q = 3 - 4 nu,

    with ``phi(a) = 0`` for a smooth edge and ``F = 2 pi int phi``. Source: Lebedev & Ufliand, J.
    Appl. Math. Mech. 22 (1958) 442; Hayes et al., J. Biomech. 5 (1972) 541 for L. Validation: X ->
    0 is Hertz; L against the equations of elasticity; nu = 0.5 within 0.7 % of Garcia & Garcia 2018
    up to X = 0.5; the slope at X = 0 within 0.6 % of Dimitriadis 2002, whose series is 2 % low at X
    = 0.27 and 8 % at X = 0.49 for nu = 0.5.
    """
    a = contact_over_thickness  # lengths in units of the thickness
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    t, w = 0.5 * a * (nodes + 1.0), 0.5 * a * weights
    # G((t+u)/h) + G((t-u)/h) is 2 int (L - 1) cos(x t) cos(x u) dx.
    x, less = _layer_less_one(poissons_ratio)
    at = np.append(t, a)
    k = 2.0 * (np.cos(at[:, None] * x) * less) @ np.cos(x[:, None] * t)
    k *= coupon_share / math.pi * w
    both = np.linalg.solve(np.eye(_POINTS) + k[:-1], np.stack((np.ones_like(t), t * t), axis=1))
    edge = np.array([1.0, a * a]) - k[-1] @ both  # phi(a) for delta = 1 and for 1/R = 1
    R_delta = edge[1] / edge[0]
    force = 2.0 * float(w @ (R_delta * both[:, 0] - both[:, 1]))
    return math.sqrt(R_delta), force / (4.0 / 3.0 * R_delta**1.5)


@lru_cache(maxsize=8)
def _layer_less_one(poissons_ratio: float) -> tuple[Vector, Vector]:
    """Return nodes of x and the weighted L - 1 there; it falls like x exp(-2x), 25 is far."""
    nodes, weights = np.polynomial.legendre.leggauss(200)
    x = 12.5 * (nodes + 1.0)
    q = 3.0 - 4.0 * poissons_ratio
    sinh, cosh = np.sinh(x), np.cosh(x)
    bottom = q * sinh**2 + x * x + 4.0 * (1.0 - poissons_ratio) ** 2
    return x, 12.5 * weights * ((q * sinh * cosh - x) / bottom - 1.0)
