"""A sphere on a bonded layer: three published forms against each other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from drivers.simulated.bonded_layer import (
    _layer_less_one,
    dimitriadis,
    garcia,
    layer_contact,
    solved_layer,
)


def factor(coefficients: np.ndarray, X: float) -> float:
    """Return ``1 + c1 X + c2 X^2 + ...``."""
    return float(1.0 + np.sum(coefficients * X ** np.arange(1, coefficients.size + 1)))


def test_dimitriadis_at_one_half_is_the_form_that_is_quoted_but_for_its_last_sign() -> None:
    """1.133, 1.283, 0.769 and -0.0975."""
    np.testing.assert_allclose(dimitriadis(0.5)[:4], [1.133, 1.283, 0.769, -0.0975], atol=5e-4)
    assert dimitriadis(0.37)[0] == pytest.approx(0.938, abs=1e-3)


@pytest.mark.parametrize("poissons_ratio", [0.3, 0.37, 0.46, 0.5])
def test_a_thick_layer_is_a_half_space_and_departs_as_dimitriadis_says(
    poissons_ratio: float,
) -> None:
    """The solution's slope at X -> 0 is his first coefficient within the 0.6 % of his fit to nu."""
    X, stiffer = layer_contact(0.005, poissons_ratio, 1.0)
    assert pytest.approx(0.005, rel=0.01) == X
    slope, curvature = dimitriadis(poissons_ratio)[:2]
    assert (stiffer - 1.0) / X - curvature * X == pytest.approx(slope, rel=6e-3)


@pytest.mark.parametrize("poissons_ratio", [0.3, 0.37, 0.49])
def test_compliance_of_the_layer_is_that_of_the_equations_of_elasticity(
    poissons_ratio: float,
) -> None:
    """Displacement and stress of one wave number carried from the base to the top by a matrix."""
    x, less = _layer_less_one(poissons_ratio)
    _, weights = np.polynomial.legendre.leggauss(x.size)
    mu, lam = 1.0, 2.0 * poissons_ratio / (1.0 - 2.0 * poissons_ratio)
    modulus = 2.0 * (1.0 + poissons_ratio)
    for i in (3, 10, 30, 60):
        k, stiff = x[i], lam + 2.0 * mu
        carried = expm(
            np.array(  # of U, W, shear and normal stress over the thickness 1
                [
                    [0.0, k, 1.0 / mu, 0.0],
                    [-lam * k / stiff, 0.0, 0.0, 1.0 / stiff],
                    [k * k * (stiff - lam**2 / stiff), 0.0, 0.0, k * lam / stiff],
                    [0.0, 0.0, -k, 0.0],
                ]
            )
        )
        base = np.linalg.solve(carried[2:, 2:], [0.0, 1.0])
        sinks = carried[1, 2:] @ base * modulus * k / (2.0 * (1.0 - poissons_ratio**2))
        assert 1.0 + less[i] / (12.5 * weights[i]) == pytest.approx(sinks, rel=1e-6)


def test_solution_is_garcias_where_that_holds_and_dimitriadis_falls_short() -> None:
    """At nu = 0.5: within 0.7 % of Garcia up to X = 0.5, where the series of 2002 lacks 8 %."""
    for a in (0.1, 0.3, 0.6):
        X, stiffer = layer_contact(a, 0.5, 1.0)
        assert stiffer == pytest.approx(factor(garcia(), X), rel=7e-3)
    assert 0.45 < X < 0.5
    assert factor(dimitriadis(0.5), X) / stiffer - 1 == pytest.approx(-0.079, abs=2e-3)


@pytest.mark.parametrize("share", [1.0, 0.4])
@pytest.mark.parametrize("poissons_ratio", [0.3, 0.37, 0.5])
def test_polynomial_follows_the_solution(poissons_ratio: float, share: float) -> None:
    """To 4e-5 of the factor, between the points it was fitted to as well."""
    coefficients = solved_layer(poissons_ratio, share)
    for a in np.linspace(0.03, 1.57, 23):
        X, whole = layer_contact(float(a), poissons_ratio, share)
        f = factor(coefficients, X)
        assert 1.0 / (1.0 - share + share / f) == pytest.approx(whole, rel=4e-5)


def test_a_stiff_layer_under_a_soft_sphere_hardly_matters() -> None:
    """Of a coupon with a hundredth of the compliance the thickness is seen at a hundredth."""
    X, whole = layer_contact(0.4, 0.37, 0.01)
    assert whole - 1.0 < 0.011 * (factor(dimitriadis(0.37), X))
