"""Single numbers around the paper's claims: late rebounds, the ring, what fixed steps cost."""

from __future__ import annotations

import itertools
import math

import numpy as np

from analysis.aliases import Array
from analysis.model.hertz import contact_time, damping_coefficient
from analysis.paper.contact import (
    FIG2_CELL,
    FIG2_DROP,
    GRAVITY_M_PER_S2,
    Cell,
    Drop,
    contact_history,
    crystal_trace,
)


def seen_after(ratio_at_lift_off: float, ratio_seen: float, speed_m_per_s: float) -> float:
    r"""Return how long after lift-off gravity has slowed a rebound to a ratio. [s]

    .. math:: (r_0 - r)\, v_0 / g

    with the ratios of rebound over impact speed then and when read.
    """
    return (ratio_at_lift_off - ratio_seen) * speed_m_per_s / GRAVITY_M_PER_S2


def ring_time(cell: Cell, share: float) -> float:
    """Return how long the free ring takes to decay to a share of its start. [s]

    It is ``-ln(share) 2 M / mu``; the cell is underdamped.
    """
    return -math.log(share) * 2 * cell.mass_kg / cell.damping_n_s_per_m


def fixed_step_error(step_s: float, drop: Drop = FIG2_DROP, restitution: float = 0.8) -> float:
    """Return how far plain RK4 in equal steps of time is off, over the peak of F_el (HSD).

    It is the largest error of the elastic force at the steps within the contact.
    """
    km = drop.stiffness / drop.mass_kg
    cd = damping_coefficient(restitution) * math.sqrt(km)

    def rates(state: Array) -> Array:
        """Return the derivative of (delta, delta')."""
        depth = max(state[0], 0.0)
        force = km * depth**1.5 + cd * depth**0.25 * state[1]
        return np.array([state[1], GRAVITY_M_PER_S2 - force])

    exact = contact_history(drop, restitution)
    count = math.floor(exact.contact_time_s / step_s)
    state = np.array([0.0, drop.speed_m_per_s])
    found = [0.0]
    for _ in range(count):
        a = rates(state)
        b = rates(state + step_s / 2 * a)
        c = rates(state + step_s / 2 * b)
        d = rates(state + step_s * c)
        state = state + step_s / 6 * (a + 2 * b + 2 * c + d)
        found.append(max(float(state[0]), 0.0))
    truth = exact.indentation_at(np.linspace(0.0, count * step_s, count + 1)) ** 1.5
    return float(np.abs(np.array(found) ** 1.5 - truth).max() / truth.max())


def ring_readings(drop: Drop, restitution: float, cell: Cell) -> tuple[float, float]:
    """Return frequency [Hz] and damping ratio as one reads them off the ring after the contact.

    They are from the downward zero crossings and the decay from one maximum to the next. The cell
    is underdamped.
    """
    period_s = 1 / cell.natural_frequency_hz
    start_s = contact_history(drop, restitution, cell).contact_time_s
    times = np.arange(0.0, start_s + 6 * period_s, 2e-9)
    ring = crystal_trace(drop, restitution, cell, times)[times >= start_s]
    rises = np.flatnonzero((ring[:-1] < 0) & (ring[1:] >= 0))
    between = float(np.diff(rises).mean()) * 2e-9
    peaks = [float(ring[a:b].max()) for a, b in itertools.pairwise(rises)]
    decay = math.log(peaks[0] / peaks[1])
    return 1 / between, decay / math.hypot(2 * math.pi, decay)


def loss_free_contact_time(drop: Drop) -> float:
    """Return how long a loss-free contact on a rigid cell lasts. [s]"""
    return contact_time(drop.stiffness, drop.mass_kg, drop.speed_m_per_s)


def mass_alone_shifts_trace_by(
    relative: float, drop: Drop = FIG2_DROP, cell: Cell = FIG2_CELL, restitution: float = 0.8
) -> float:
    """Return how much the trace changes when M changes and S = k c, omega0 and zeta do not.

    That is the largest change of the signal over its peak, per unit of ``relative``, the change of
    M over M. The signal is Delta / c; with S fixed it goes like k Delta.
    """
    times = np.arange(0.0, 4e-4, 1e-7)
    f = 1 + relative
    changed = Cell(cell.mass_kg * f, cell.stiffness_n_per_m * f, cell.damping_n_s_per_m * f)
    one = crystal_trace(drop, restitution, cell, times)
    other = f * crystal_trace(drop, restitution, changed, times)
    return float(np.abs(other - one).max() / one.max() / abs(relative))


def signal_overshoot(drop: Drop, restitution: float, cell: Cell) -> float:
    """Return how far the crystal swings beyond the force that presses on it. [1]

    It is ``k Delta_max / F_max``: a rigid cell's S comes out too small by this factor.
    """
    history = contact_history(drop, restitution, cell)
    times = np.arange(0.0, history.contact_time_s + 1 / cell.natural_frequency_hz, 1e-8)
    crystal = crystal_trace(drop, restitution, cell, times)
    return float(cell.stiffness_n_per_m * crystal.max() / history.elastic_n.max())
