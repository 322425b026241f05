"""The fall in air against DOP853 in time, and its limits."""

from __future__ import annotations

import math

import pytest

from analysis.model.free_fall import (
    AIR_DENSITY_KG_PER_M3,
    AIR_RESISTANCE_U,
    AIR_VISCOSITY_PA_S,
    speed_in_air,
)

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


@pytest.mark.parametrize(("radius", "density"), [(1.5e-3, 900.0), (3e-3, 1400.0), (5e-3, 7800.0)])
@pytest.mark.parametrize("height", [0.01, 0.06])
def test_the_history_force_that_is_left_out_is_of_the_order_of_the_drag(
    radius: float, density: float, height: float
) -> None:
    """By Basset's law for a constant acceleration: hence the drag's standard uncertainty."""
    mass, displaced = (
        4 / 3 * math.pi * radius**3 * rho for rho in (density, AIR_DENSITY_KG_PER_M3)
    )
    inertia = mass + displaced / 2
    pull = (mass - displaced) * G / inertia
    basset = 6 * radius**2 * math.sqrt(math.pi * AIR_DENSITY_KG_PER_M3 * AIR_VISCOSITY_PA_S)
    # the force 2 basset a sqrt(t) does the work int F a t dt, and the speed at the end is a T
    duration = math.sqrt(2 * height / pull)
    history = 2 * basset * pull / inertia * duration**1.5 / 2.5
    drag = math.sqrt(2 * pull * height) - speed_in_air(height, radius, mass, G)
    assert 0.25 < history / drag < 2.4 * AIR_RESISTANCE_U


def test_without_resistance_only_buoyancy_is_left() -> None:
    """The drag's multiple is 0, and the fall is uniformly accelerated."""
    radius, mass, height = 3e-3, 1.6e-4, 0.047
    displaced = 4 / 3 * math.pi * radius**3 * AIR_DENSITY_KG_PER_M3
    pull = (mass - displaced) * G / (mass + displaced / 2)
    found = speed_in_air(height, radius, mass, G, resistance=0.0)
    assert found == pytest.approx(math.sqrt(2 * pull * height), rel=1e-12)
