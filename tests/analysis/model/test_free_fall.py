"""The fall in air against DOP853 in time, and its limits."""

from __future__ import annotations

import math

import pytest

from analysis.model.free_fall import speed_in_air

from ..closed_reference import fallen

G = 9.80665


@pytest.mark.parametrize("height", [0.002, 0.047, 0.3])
@pytest.mark.parametrize(("radius", "mass"), [(4.76e-3, 4.232e-4), (3.175e-3, 1.895e-4)])
def test_speed_is_that_of_the_equation_of_motion(height: float, radius: float, mass: float) -> None:
    """The speed agrees with DOP853 in time to 1e-7."""
    found = speed_in_air(height, radius, mass, G)
    assert found == pytest.approx(fallen(height, radius, mass), rel=1e-7)


def test_without_air_it_is_free_fall() -> None:
    """In thin air of no viscosity the speed is sqrt(2 g h)."""
    found = speed_in_air(
        0.047, 4.76e-3, 6e-4, G, air_density_kg_per_m3=1e-9, air_viscosity_pa_s=1e-12
    )
    assert found == pytest.approx(math.sqrt(2 * G * 0.047), rel=1e-6)


def test_air_takes_a_third_of_a_per_cent_of_the_energy() -> None:
    """A polymer sphere of 4.76 mm from 47 mm arrives with some 0.3 % less energy."""
    share = 1 - speed_in_air(0.047, 4.76e-3, 6.116e-4, G) ** 2 / (2 * G * 0.047)
    assert 0.002 < share < 0.005
