"""Measurands as JSON, and Young's modulus from a plane-strain one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.campaign import Quantity
from analysis.fit.measurand import as_quantity, measurand, young_from_plane_strain


@pytest.mark.parametrize("relative_u", [0.002, 0.02, 0.2])
def test_young_of_a_reference_agrees_with_sampling(relative_u: float) -> None:
    """The posterior of E, given priors on E and nu and a measured E', is that of draws to 8 %."""
    rng = np.random.default_rng(8)
    prior, ratio = Quantity(3.1e9, 0.06e9), Quantity(0.36, 0.02)
    measured = math.log(3.7e9)
    log_e = math.log(prior.value) + prior.u / prior.value * rng.standard_normal(2_000_000)
    nu = ratio.value + ratio.u * rng.standard_normal(log_e.size)
    weight = np.exp(-0.5 * ((log_e - np.log(1 - nu**2) - measured) / relative_u) ** 2)
    mean = float(np.average(log_e, weights=weight))
    u = math.sqrt(float(np.average((log_e - mean) ** 2, weights=weight)))
    # what a fit hands over is the posterior of E', prior included
    b = -math.log(1 - ratio.value**2)
    var_b = (2 * ratio.value * ratio.u / (1 - ratio.value**2)) ** 2
    var = (prior.u / prior.value) ** 2 + var_b
    precision = 1 / var + 1 / relative_u**2
    log_plane = ((math.log(prior.value) + b) / var + measured / relative_u**2) / precision
    e, u_e = young_from_plane_strain(log_plane, precision**-0.5, prior, ratio)
    assert math.log(e) == pytest.approx(mean, abs=0.1 * u)
    # E' is linearised in nu, whose curvature is the difference
    assert u_e == pytest.approx(u, rel=0.08)


def test_young_of_an_unknown_carries_all_of_the_ratios_uncertainty() -> None:
    """Without a prior on E, nu's whole uncertainty goes into E, as sampling has it."""
    rng = np.random.default_rng(9)
    nu = 0.37 + 0.02 * rng.standard_normal(400_000)
    draws = math.log(2.4e9) + 0.01 * rng.standard_normal(nu.size) + np.log(1 - nu**2)
    e, u = young_from_plane_strain(math.log(2.4e9), 0.01, None, Quantity(0.37, 0.02))
    assert math.log(e) == pytest.approx(draws.mean(), abs=1e-3)
    assert u == pytest.approx(draws.std(), rel=0.02)


def test_exactly_known_materials_stay_as_stated() -> None:
    """A modulus and ratio stated without uncertainty are not moved by any fit."""
    e, u = young_from_plane_strain(math.log(9e9), 0.1, Quantity(7e10, 0.0), Quantity(0.33, 0.0))
    assert (e, u) == (7e10, 0.0)


def test_intervals_of_positive_quantities_stay_positive() -> None:
    """A wide interval of a positive quantity is symmetric in its logarithm."""
    found = measurand(2.0, 1.5, "Pa")
    assert found is not None
    low, high = found["interval95"]
    assert 0 < low < 2.0 < high
    assert low * high == pytest.approx(4.0)
    assert found["expanded"]["U"] == pytest.approx(1.96 * 1.5, rel=1e-3)
    assert as_quantity(found) == Quantity(2.0, 1.5)


def test_offsets_have_symmetric_intervals() -> None:
    """A quantity that may be negative has value +- U."""
    found = measurand(-1.0, 0.5, "V")
    assert found is not None
    assert found["interval95"] == pytest.approx([-1.98, -0.02], abs=1e-3)


@pytest.mark.parametrize(("value", "u"), [(math.nan, 1.0), (1.0, math.inf), (math.inf, 0.0)])
def test_what_is_not_finite_is_not_printed(value: float, u: float) -> None:
    """NaN and infinity never reach a result; null does."""
    assert measurand(value, u, "Pa") is None


def test_huge_uncertainty_stays_finite() -> None:
    """An undetermined logarithm still gives finite numbers."""
    found = measurand(1.0, 500.0, "Pa")
    assert found is not None
    assert all(math.isfinite(x) for x in found["interval95"])
