"""The paper's inputs, and every state of one contact, not only the trace.

The paper is B. J. Maranzano, B. C. Hancock, Sensing and Bio-Sensing Research 7 (2016) 31-37. Signs:
compression is positive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from analysis.aliases import Array
from analysis.model import solver
from analysis.model.hertz import (
    closed_damping_coefficient,
    contact_stiffness,
    damping_coefficient,
    plane_strain_modulus,
    reduced_modulus,
)

GRAVITY_M_PER_S2 = 9.80665
FINE_STEPS = 1500
"""Over the contact; states between them are interpolated, and 1e-9 of the peak is left."""


@dataclass(frozen=True)
class Cell:
    """The crystal of Eqs 8-10: M, k, mu."""

    mass_kg: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float

    @property
    def natural_frequency_hz(self) -> float:
        """Return ``sqrt(k/M) / 2 pi``. [Hz]"""
        return math.sqrt(self.stiffness_n_per_m / self.mass_kg) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Return ``mu / (2 sqrt(k M))``. [1]"""
        return self.damping_n_s_per_m / (2 * math.sqrt(self.stiffness_n_per_m * self.mass_kg))


@dataclass(frozen=True)
class Drop:
    """A sphere on its way to a coupon."""

    stiffness: float
    """K of Eq. 2. [N m^-1.5]"""
    mass_kg: float
    speed_m_per_s: float


def drop_of(
    radius_m: float,
    mass_kg: float,
    reduced_modulus_pa: float,
    height_m: float,
) -> Drop:
    """Return a drop from its label, with K of Eq. 4 and ``v0 = sqrt(2 g h)``."""
    speed = math.sqrt(2 * GRAVITY_M_PER_S2 * height_m)
    return Drop(contact_stiffness(reduced_modulus_pa, radius_m), mass_kg, speed)


_SAME = plane_strain_modulus(3.0e9, 0.33)
FIG2_DROP = drop_of(4.76e-3, 0.407e-3, reduced_modulus(_SAME, _SAME), 0.047)
FIG2_CELL = Cell(0.100, 1.0e9, 3.0e3)
TABLE3_CELL = Cell(35.4e-3, 0.416e9, 0.56e3)
TABLE3_COMPLIANCE_M_PER_V = 5.6e-9
TABLE3_HSD_N_PER_V = 1.78


@dataclass(frozen=True)
class History:
    """All states of one contact on the solver's own grid, shape (n,) each.

    From touch-down to lift-off, both included.
    """

    time_s: Array
    indentation_m: Array
    indentation_rate_m_per_s: Array
    crystal_m: Array
    """Compression of the crystal; zeros on a rigid cell."""
    crystal_rate_m_per_s: Array
    elastic_n: Array
    """Eq. 2."""
    dissipative_n: Array
    """Eq. 3."""

    @property
    def contact_time_s(self) -> float:
        """Return tau of Eq. 6. [s]"""
        return float(self.time_s[-1])

    @property
    def rebound_speed_m_per_s(self) -> float:
        """Return the sphere's speed upwards at lift-off. [m/s]"""
        return -float(self.indentation_rate_m_per_s[-1] + self.crystal_rate_m_per_s[-1])

    def indentation_at(self, times_s: Array) -> Array:
        """Return the indentation at these times, 0 outside the contact. [m]"""
        curve = CubicHermiteSpline(self.time_s, self.indentation_m, self.indentation_rate_m_per_s)
        inside = (times_s >= 0) & (times_s <= self.contact_time_s)
        return np.where(inside, np.maximum(curve(np.where(inside, times_s, 0.0)), 0.0), 0.0)


def contact_history(
    drop: Drop,
    restitution: float,
    cell: Cell | None = None,
    *,
    steps: int = FINE_STEPS,
    closed: bool = False,
) -> History:
    """Return all states of one contact: what `solver.integrate` passes through.

    ``restitution`` is eps of Eq. 6; without a cell it is HSD's rigid one. ``closed`` is as in
    `solver.integrate`; the cell's mass then holds the coupon's too. Source: Eqs 1-10. Validation:
    the same steps as `solver.integrate`, which is held to DOP853; ``tests/analysis/test_paper.py``
    compares the two.
    """
    km = drop.stiffness / drop.mass_kg
    cd = _loss(restitution, closed=closed) * math.sqrt(km)
    end_cd = max(cd, 0.0) if closed else 0.0
    big_km, big_cd, w2, g2 = 0.0, 0.0, 0.0, 0.0
    if cell is not None:
        big_km = drop.stiffness / cell.mass_kg
        w2 = cell.stiffness_n_per_m / cell.mass_kg
        g2 = cell.damping_n_s_per_m / cell.mass_kg
        big_cd = cd * drop.mass_kg / cell.mass_kg if closed else 0.0
    law = (km, cd, big_km, big_cd, w2, g2, GRAVITY_M_PER_S2)
    depth = (1.25 * drop.speed_m_per_s**2 / km) ** 0.4
    h = 13.05 * depth**0.25 / drop.speed_m_per_s / steps  # as in solver.integrate
    state = (0.0, drop.speed_m_per_s, 0.0, 0.0, 0.0)
    states = [state]
    while len(states) < 20 * steps:
        ahead = solver._step(*state, h, *law)
        if ahead[1] < 0.0 and km * ahead[0] ** 5 + end_cd * ahead[1] <= 0.0:
            ahead = solver._step(*state, solver._lift_off(*state, h, *law, end_cd), *law)
            states.append(ahead if end_cd > 0.0 else (0.0, *ahead[1:]))
            break
        state = ahead
        states.append(state)
    found = np.array(states)
    # the grid is so fine at both ends that neighbours may share a time; the later one stays
    found = found[np.append(np.diff(found[:, 4]) > 0, True)]
    y, u, crystal, w, t = found.T
    elastic = drop.stiffness * y**6
    dissipative = drop.mass_kg * cd * y * u
    return History(t, y**4, u, crystal, w, elastic, dissipative)


def crystal_trace(
    drop: Drop, restitution: float, cell: Cell, times_s: Array, *, closed: bool = False
) -> Array:
    """Return the crystal's compression Delta [m] at equally spaced times, ring included.

    The times [s] count from touch-down; all else is as for `contact_history`.
    """
    return solver.trace(
        kind=solver.KV,
        sample_times_start_s=float(times_s[0]),
        sample_interval_s=float(times_s[1] - times_s[0]),
        samples=times_s.size,
        stiffness=drop.stiffness,
        mass_kg=drop.mass_kg,
        speed_m_per_s=drop.speed_m_per_s,
        alpha=_loss(restitution, closed=closed),
        crystal_mass_kg=cell.mass_kg,
        crystal_stiffness_n_per_m=cell.stiffness_n_per_m,
        crystal_damping_n_s_per_m=cell.damping_n_s_per_m,
        closed=closed,
    )[0]


def _loss(restitution: float, *, closed: bool) -> float:
    """Return alpha of Eq. 3 for a rebound where the indentation, or the force, is back at zero."""
    return closed_damping_coefficient(restitution) if closed else damping_coefficient(restitution)
