"""The constant of a loss law from a coefficient of restitution.

Each law is made dimensionless by ``D = (m v^2 / K)^(2/5)``; on a rigid cell without gravity the
restitution is then a function of one number.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from drivers.simulated import impact_kernel as kernel
from drivers.simulated.impact import Mechanics, simulate_impact

_NUMBERS = np.geomspace(2e-3, 3.0, 60)
"""A v / D over which Kuwabara and Kono's restitution is tabled, from 0.997 to below 0.2."""


def hunt_crossley_constant(restitution: float, speed_m_per_s: float) -> float:
    """Return chi of ``K delta^(3/2) (1 + chi delta')`` that gives a restitution at a speed.

    ``y - ln(1 + y) = -eps y - ln(1 - eps y)`` with ``y = chi v``: exact, whatever K and m.
    Source: Hunt & Crossley 1975, whose first order is ``1 - eps = (2/3) chi v``; the closed form
    is that of Marhefka & Orin, IEEE Trans. Syst. Man Cybern. A 29 (1999) 566.

    chi is in s/m; the restitution is in (0, 1].
    """
    if restitution >= 1.0:
        return 0.0
    low, high = 1e-9, 1.0 / restitution
    while high - low > 1e-14 * high:
        y = 0.5 * (low + high)
        kept = (
            -restitution * y - math.log1p(-restitution * y) if restitution * y < 1.0 else math.inf
        )
        low, high = (y, high) if kept < y - math.log1p(y) else (low, y)
    return low / speed_m_per_s


def kuwabara_kono_constant(
    restitution: float, speed_m_per_s: float, *, mass_kg: float, contact_stiffness: float, rule: int
) -> float:
    """Return A of ``(3/2) A K sqrt(delta) delta'`` that gives a restitution at a speed.

    Source: Kuwabara & Kono 1987. Small losses: ``1 - eps = (3/2) C1 A v / D``, C1 = 1.15344
    (Ramirez et al., Phys. Rev. E 60 (1999) 4465).

    A is in s; the restitution is in (0.2, 1]. ``contact_stiffness`` is K of Eq. 4, ``rule`` the
    kernel's rule of lift-off.
    """
    if restitution >= 1.0:
        return 0.0
    loss = _kuwabara_kono_losses(rule)
    number = math.exp(float(np.interp(math.log(1.0 - restitution), loss, np.log(_NUMBERS))))
    depth = math.pow(mass_kg * speed_m_per_s**2 / contact_stiffness, 0.4)
    return number * depth / speed_m_per_s


@lru_cache(maxsize=2)
def _kuwabara_kono_losses(rule: int) -> NDArray[np.float64]:
    """Return ln(1 - eps) over `_NUMBERS`, by dropping one sphere on a rigid cell."""
    bodies = Mechanics(
        6e-4, 4.76e-3, 1.5e9, 1.0, 0.0, 1.0, 1.0, 0.0,
        rigid=True, lift_off_rule=rule, loss_law=kernel.KUWABARA_KONO_LOSS,
    )  # fmt: skip
    speed = 0.77
    unit_s = (bodies.sphere_mass_kg * speed**2 / bodies.contact_stiffness) ** 0.4 / speed
    kept = [
        simulate_impact(replace(bodies, loss_constant=float(n) * unit_s), speed, points=1)
        for n in _NUMBERS
    ]
    return np.log([1.0 - impact.rebound_speed_m_per_s / speed for impact in kept])
