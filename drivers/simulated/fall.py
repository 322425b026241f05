"""The motion of a sphere in still air, in the fall and between bounces.

    (m + c m_a) v' = (m - m_a) g - (1/2) rho C_d pi R^2 |v| v

``m_a`` is the mass of the displaced air: buoyancy, and ``c`` of it is dragged along (1/2 of it for
a sphere in potential flow, Lamb, Hydrodynamics, art. 92). The history force of Basset is left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

PRESSURE_PA = 101_325.0
GAS_CONSTANT_J_PER_KG_K = 287.05  # of dry air
_STEPS = 64  # Runge-Kutta steps a flight; halving them moves the speed by less than 1e-9 of itself


@dataclass(frozen=True)
class Body:
    """A sphere in flight, and the air around it."""

    radius_m: float
    mass_kg: float
    gravity_m_per_s2: float
    temperature_k: float = 296.15
    """Of the air."""


def air_density_kg_per_m3(temperature_k: float) -> float:
    """Return the density of dry air at normal pressure, an ideal gas. [kg/m^3]"""
    return PRESSURE_PA / (GAS_CONSTANT_J_PER_KG_K * temperature_k)


def air_viscosity_pa_s(temperature_k: float) -> float:
    """Return the viscosity of air after Sutherland (1893; constants of White 2006). [Pa s]"""
    warmer = math.pow(temperature_k / 273.15, 1.5)
    return 1.716e-5 * warmer * (273.15 + 110.4) / (temperature_k + 110.4)


def schiller_naumann(reynolds: float) -> float:
    """Return C_d = 24/Re (1 + 0.15 Re^0.687) of a sphere, Re < 1000.

    Source: Schiller & Naumann 1933; Clift, Grace & Weber, Bubbles, Drops and Particles (1978),
    ch. 5, within 5 %.
    """
    return 24.0 / reynolds * (1.0 + 0.15 * math.pow(reynolds, 0.687))


def brown_lawler(reynolds: float) -> float:
    """Return C_d = 24/Re (1 + 0.150 Re^0.681) + 0.407/(1 + 8710/Re) of a sphere, Re < 2e5.

    Source: Brown & Lawler, J. Environ. Eng. 129 (2003) 222, Eq. 19.
    """
    wake = 0.407 / (1.0 + 8710.0 / reynolds)
    return 24.0 / reynolds * (1.0 + 0.150 * math.pow(reynolds, 0.681)) + wake


DRAG = {"schiller_naumann": schiller_naumann, "brown_lawler": brown_lawler}
"""Forms of C_d by name."""


def fly(
    body: Body,
    height_m: float,
    *,
    drag: str,
    added_mass: float = 0.0,
    speed_up_m_per_s: float = 0.0,
) -> tuple[float, float]:
    """Return the time of flight [s] and the speed downwards on arrival [m/s].

    The sphere arrives ``height_m`` below the start, which may be a little below zero after a
    bounce. ``drag`` is one of `DRAG`, or ``"none"`` for no air at all; ``added_mass`` the part of
    the displaced air's mass that moves along; ``speed_up_m_per_s`` the speed upwards at the start.
    """
    g = body.gravity_m_per_s2
    arrival = math.sqrt(max(speed_up_m_per_s**2 + 2.0 * g * height_m, 0.0))
    vacuum_s = (speed_up_m_per_s + arrival) / g
    if drag == "none":
        return vacuum_s, arrival
    density, viscosity = (
        f(body.temperature_k) for f in (air_density_kg_per_m3, air_viscosity_pa_s)
    )
    displaced = density * 4.0 / 3.0 * math.pi * body.radius_m**3
    inertia = body.mass_kg + added_mass * displaced
    weight = (body.mass_kg - displaced) * g
    area = math.pi * body.radius_m**2
    per_speed = 2.0 * body.radius_m * density / viscosity
    coefficient = DRAG[drag]

    def gain(v: float) -> float:
        """Return the acceleration at a speed. [m/s^2]"""
        if v == 0.0:
            return weight / inertia
        brake = 0.5 * density * coefficient(per_speed * abs(v)) * area * abs(v) * v
        return (weight - brake) / inertia

    # Runge and Kutta's fourth order until the vacuum's time is over, then what is left of the way.
    h, v, fallen = vacuum_s / _STEPS, -speed_up_m_per_s, 0.0
    for _ in range(_STEPS):
        a1 = gain(v)
        a2 = gain(v + 0.5 * h * a1)
        a3 = gain(v + 0.5 * h * a2)
        a4 = gain(v + h * a3)
        fallen += h * v + h * h / 6.0 * (a1 + a2 + a3)
        v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    acceleration = gain(v)
    left = height_m - fallen
    rest_s = 2.0 * left / (v + math.sqrt(max(v * v + 2.0 * acceleration * left, 0.0)))
    return vacuum_s + rest_s, v + acceleration * rest_s
