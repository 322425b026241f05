"""What a cell shows of a drop from the paper's tables (its Figs 5 and 6), by each of the models."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from analysis.aliases import Array
from analysis.model import solver
from analysis.model.hertz import damping_coefficient
from analysis.paper.contact import Cell, Drop, crystal_trace


def hsd_volts(drop: Drop, restitution: float, newtons_per_volt: float, times_s: Array) -> Array:
    """Return the trace of a rigid cell, Eq. 7.

    Parameters
    ----------
    restitution : float
        eps of Eq. 6. [1]
    newtons_per_volt : float
        S of Eq. 7. [N/V]
    times_s : ndarray, shape (n,)
        After touch-down, equally spaced; may begin before it. [s]

    Returns
    -------
    ndarray, shape (n,)
        ``F_el / S``. [V]
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
    """Return the trace of a Kelvin-Voigt cell, Eq. 11.

    Parameters
    ----------
    drop, restitution
        As for `hsd_volts`.
    cell : Cell
        The crystal, without a coupon.
    compliance_m_per_v : float
        c of Eq. 11. [m/V]
    times_s
        As for `hsd_volts`.
    coupon_kg : float, optional
        None for ``kv``, as printed. A mass makes it ``kv2``: the coupon rides on the crystal, the
        dashpot loads it, and the contact ends with its force. [kg]

    Returns
    -------
    ndarray, shape (n,)
        ``Delta / c``. [V]
    """
    if coupon_kg is not None:
        cell = replace(cell, mass_kg=cell.mass_kg + coupon_kg)
    closed = coupon_kg is not None
    return crystal_trace(drop, restitution, cell, times_s, closed=closed) / compliance_m_per_v


def maxima(times_s: Array, signal: Array, above: float) -> list[tuple[float, float]]:
    """Return the local maxima of a smooth signal.

    Parameters
    ----------
    times_s, signal : ndarray, shape (n,)
        [s, any]
    above : float
        Share of the largest value below which a maximum does not count. [1]

    Returns
    -------
    list of tuple of float
        (time, value) in order of time.
    """
    inner = signal[1:-1]
    tops = (inner > signal[:-2]) & (inner >= signal[2:]) & (inner > above * signal.max())
    return [(float(times_s[i]), float(signal[i])) for i in np.flatnonzero(tops) + 1]


def width_at_half(times_s: Array, signal: Array) -> float:
    """Return how long a pulse with one maximum is above half of it. [s]"""
    above = times_s[signal >= 0.5 * signal.max()]
    return float(above[-1] - above[0])
