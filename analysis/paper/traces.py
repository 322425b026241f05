"""What a cell shows of a drop from the paper's tables (its Figs 5 and 6), by each of the models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.aliases import Array
from analysis.model import solver
from analysis.model.hertz import damping_coefficient
from analysis.paper.contact import Cell, Drop, crystal_trace


def hsd_volts(drop: Drop, restitution: float, newtons_per_volt: float, times_s: Array) -> Array:
    """Return the trace of a rigid cell, Eq. 7: ``F_el / S``. [V]

    ``restitution`` is eps of Eq. 6. The times are after touch-down and equally spaced; they may
    begin before it. [s]
    """
    return solver.trace(
        kind=solver.HSD,
        sample_times_start_s=float(times_s[0]),
        sample_interval_s=float(times_s[1] - times_s[0]),
        samples=times_s.size,
        stiffness=drop.stiffness,
        mass_kg=drop.mass_kg,
        speed_m_per_s=drop.speed_m_per_s,
        alpha=damping_coefficient(restitution),
        gain=1.0 / newtons_per_volt,
    )[0]


def kv_volts(
    drop: Drop,
    restitution: float,
    cell: Cell,
    compliance_m_per_v: float,
    times_s: Array,
    *,
    coupon_kg: float | None = None,
) -> Array:
    """Return the trace of a Kelvin-Voigt cell, Eq. 11: ``Delta / c``. [V]

    The cell is the crystal without a coupon. ``coupon_kg`` None gives ``kv``, as printed. A mass
    makes it ``kv2``: the coupon rides on the crystal, the dashpot loads it, and the contact ends
    with its force. All else is as for `hsd_volts`.
    """
    if coupon_kg is not None:
        cell = replace(cell, mass_kg=cell.mass_kg + coupon_kg)
    closed = coupon_kg is not None
    return crystal_trace(drop, restitution, cell, times_s, closed=closed) / compliance_m_per_v


def maxima(times_s: Array, signal: Array, above: float) -> list[tuple[float, float]]:
    """Return the local maxima of a smooth signal as (time, value), in order of time.

    A maximum below the share ``above`` of the largest value does not count.
    """
    inner = signal[1:-1]
    tops = (inner > signal[:-2]) & (inner >= signal[2:]) & (inner > above * signal.max())
    return [(float(times_s[i]), float(signal[i])) for i in np.flatnonzero(tops) + 1]


def width_at_half(times_s: Array, signal: Array) -> float:
    """Return how long a pulse with one maximum is above half of it. [s]"""
    above = times_s[signal >= 0.5 * signal.max()]
    return float(above[-1] - above[0])
