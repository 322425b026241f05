"""A scan over contact times: compares the record with a series of traces, compiled.

A hundred and twenty traces a shot are most of what a single shot's start costs, so nothing of the
loop is Python.
"""

# ruff: noqa: PLR0917 - a compiled kernel takes its numbers by position
from __future__ import annotations

import math

import numpy as np
from numba import njit

from analysis.fit.fit_shot import FitShot
from analysis.model import solver
from analysis.model.hertz import (
    CONTACT_TIME_FACTOR,
    closed_damping_coefficient,
    damping_coefficient,
)
from analysis.model.impact_model import ImpactModel

CONTACT_TIMES = 40
STEP_SHARE = 0.5
"""Of the steps that 1e-6 of the peak needs; 3e-5 is plenty to lay a trace on a record."""
PEAK_SLACK = 2
"""Peak is laid on peak, and so many samples to either side."""


def stiffness_for(duration_s: float, mass_kg: float, speed: float) -> float:
    """Return the K whose loss-free contact lasts so long. [N m^-1.5]"""
    depth = duration_s * speed / CONTACT_TIME_FACTOR
    return float(1.25 * mass_kg * speed**2 / depth**2.5)


@njit(cache=True, fastmath={"reassoc", "contract"})
def _dot(a, b, n):  # type: ignore[no-untyped-def]
    """Return the sum of products of the first n; the order of a sum is free, so it runs in SIMD."""
    total = 0.0
    for i in range(n):
        total += a[i] * b[i]
    return total


@njit(cache=True)
def _best(y, peak_at, kind, dt, stiffness, steps, m, v0, alpha, g, M, k, mu, gain, closed):  # type: ignore[no-untyped-def]
    """Return (squared error, which stiffness, amplitude, shift) of the best trace and place."""
    n = y.size
    energy = _dot(y, y, n)
    found = (math.inf, stiffness.size - 1, 1.0, 0)
    shape = np.empty(n)
    for j in range(stiffness.size):
        shape[:] = 0.0
        solver.integrate(
            shape, kind, 0.0, dt, stiffness[j], m, v0, alpha, g, M, k, mu, gain, steps[j], closed
        )
        middle = peak_at - int(np.argmax(shape))
        whole = _dot(shape, shape, n)
        for shift in range(middle - PEAK_SLACK, middle + PEAK_SLACK + 1):
            if shift < 0 or shift >= n:
                continue
            rest = shape[n - shift :]
            power = whole - _dot(rest, rest, shift)
            if not power > 1e-12 * whole:
                continue
            amplitude = _dot(shape, y[shift:], n - shift) / power
            error = energy - amplitude**2 * power
            if amplitude > 0.0 and error < found[0]:
                found = (error, j, amplitude, shift)
    return found


def best_contact_time(
    item: FitShot, model: ImpactModel, *, speed: float, omega0: float, zeta: float, e: float
) -> tuple[float, float, float, int]:
    """Return the contact time whose trace fits a record best.

    The traces are those of the model's base, with the ring ``omega0`` [rad/s] and ``zeta`` [1] of
    the crystal and whatever rides on it, and restitution ``e``. Return the sum of squares that is
    left, the contact time [s], the amplitude of the trace at unit gain [unit of the signal per N],
    and the sample of touch-down in the window.
    """
    dt = 1.0 / item.frame.sample_rate_hz
    width = item.window.width_s
    times = np.geomspace(max(2.0 * dt, width / 8), 1.6 * width, CONTACT_TIMES)
    mass = item.frame.mass_kg
    crystal = 1e3 * mass
    k = crystal * omega0**2
    ringing = model.kind == solver.KV
    steps = [STEP_SHARE * solver.contact_steps(omega0 if ringing else 0.0, float(t)) for t in times]
    error, j, amplitude, shift = _best(
        item.window.signal - item.window.baseline,
        item.window.peak_index,
        model.kind,
        dt,
        np.array([stiffness_for(float(t), mass, speed) for t in times]),
        np.array(steps, dtype=np.int64),
        mass,
        speed,
        closed_damping_coefficient(e) if model.closed else damping_coefficient(e),
        item.frame.gravity_m_per_s2,
        crystal,
        k,
        2 * zeta * crystal * omega0,
        k if ringing else 1.0,
        model.closed,
    )
    return float(error), float(times[j]), float(amplitude), int(shift)
