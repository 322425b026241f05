r"""The speed of a sphere that falls through air from rest.

.. math::

    (m + \tfrac12 m_a)\,\dot v = (m - m_a)\,g - 6\pi\eta R\,v\,(1 + 0.15\,Re^{0.687}), \qquad
    Re = 2 R v \rho / \eta, \quad m_a = \tfrac43 \pi R^3 \rho

with buoyancy, the added mass of an accelerated sphere [2]_ and the drag of Schiller & Naumann [1]_.

References
----------
.. [1] L. Schiller, A. Naumann, VDI-Zeitschrift 77 (1933) 318; R. Clift, J. R. Grace, M. E. Weber,
   Bubbles, Drops, and Particles (1978), ch. 5.
.. [2] L. D. Landau, E. M. Lifshitz, Fluid Mechanics (1987), sect. 11.
"""

from __future__ import annotations

import math
from functools import lru_cache

AIR_DENSITY_KG_PER_M3 = 1.204
"""Dry air at 20 degC and 101.325 kPa."""
AIR_VISCOSITY_PA_S = 1.81e-5
"""Air at 20 degC."""
AIR_RESISTANCE_U = 0.5
"""Standard uncertainty of the drag, as a share of it. Derived: two of it are the whole drag, as the
history force is left out. That takes 0.3 to 1.2 times as much speed as the drag does: spheres of
1.5 to 5 mm radius that fall 10 to 60 mm, by Basset's law, which is an upper bound here."""
AIR_ASSUMED = (
    "Air of 20 degC and 101.3 kPa assumed for drag and buoyancy in the speed of fall "
    f"({AIR_DENSITY_KG_PER_M3:g} kg/m^3, {AIR_VISCOSITY_PA_S:g} Pa s)."
)
_STEPS = 16


@lru_cache(maxsize=4096)
def speed_in_air(
    height_m: float,
    radius_m: float,
    mass_kg: float,
    gravity_m_per_s2: float = 9.80665,
    *,
    resistance: float = 1.0,
    air_density_kg_per_m3: float = AIR_DENSITY_KG_PER_M3,
    air_viscosity_pa_s: float = AIR_VISCOSITY_PA_S,
) -> float:
    """Return the speed of a sphere after a fall through air from rest. [m/s]

    0 for a sphere lighter than the air it displaces. Drag valid up to Re = 800, within 5 % of the
    standard curve: a sphere of 5 mm radius falls 60 mm before that. The law is a quasi-steady one:
    the history force is left out. ``resistance`` is the drag over the law's [1]. Runge-Kutta's
    fourth order in the root of the way, in which the squared speed is smooth. Validation:
    ``tests/analysis/model/test_free_fall.py`` against DOP853 in time.
    """
    displaced = 4 / 3 * math.pi * radius_m**3 * air_density_kg_per_m3
    inertia = mass_kg + 0.5 * displaced
    pull = (mass_kg - displaced) * gravity_m_per_s2 / inertia
    stokes = resistance * 6 * math.pi * air_viscosity_pa_s * radius_m / inertia
    reynolds_per_speed = 2 * radius_m * air_density_kg_per_m3 / air_viscosity_pa_s

    def slope(root: float, squared: float) -> float:
        """Return d(v^2)/d(root), the way being height * root^2."""
        v = math.sqrt(max(squared, 0.0))
        drag: float = stokes * v * (1 + 0.15 * (reynolds_per_speed * v) ** 0.687)
        return 4 * height_m * root * (pull - drag)

    squared, h = 0.0, 1.0 / _STEPS
    for i in range(_STEPS):
        x = i * h
        a = slope(x, squared)
        b = slope(x + h / 2, squared + h / 2 * a)
        c = slope(x + h / 2, squared + h / 2 * b)
        d = slope(x + h, squared + h * c)
        squared += h / 6 * (a + 2 * b + 2 * c + d)
    return math.sqrt(max(squared, 0.0))
