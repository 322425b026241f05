r"""Compiled integration of the impact: HSD, KV, KV closed, on a grid dense at touch and lift-off.

The dashpot of Eq. 3 goes like :math:`\delta^{1/4}\dot\delta`, whose slope is infinite at touch-down
and lift-off, so a scheme in equal steps of time converges slowly there. With

.. math:: y = \delta^{1/4}, \quad dt = y^3\, ds

every right-hand side becomes a polynomial:

.. math::

    dy/ds = u/4, \quad
    du/ds = y^3\,[g - (F_{el} + F_{dis})/m - (F_{el} - k\Delta - \mu w)/M], \\
    d\Delta/ds = y^3 w, \quad dw/ds = y^3 (F_{el} - k\Delta - \mu w)/M, \quad dt/ds = y^3, \\
    F_{el} = K y^6, \quad F_{dis} = \alpha\sqrt{mK}\, y\, u

(u indentation rate, w crystal rate). Equal steps in s are graded in t like s^4 at both ends, touch
and lift-off are simple zeros of y, and a fifth-order Runge-Kutta scheme keeps its order. Between
steps the samples come from quintic Hermite polynomials in t (value, rate, acceleration at both
ends); after lift-off the crystal's ring is exact.

The paper's models end the contact at :math:`\delta = 0` and load the crystal with F_el alone. The
closed form (``closed``) loads it with F_el + F_dis and ends where that sum is zero, which is again
a simple zero, of

.. math:: H = y - \left(-c\,u / K\right)^{1/5}, \qquad c = \alpha\sqrt{mK}

because :math:`F = y\,(K y^5 + c\,u)`; without a dashpot H is y itself. The surface is then still
indented: it recovers behind the sphere (delayed recovery) [1]_.

Signs: indentation, crystal compression and forces are positive in compression; speed downwards.

References
----------
.. [1] T. Schwager, T. Poeschel, Phys. Rev. E 78 (2008) 051304.
"""

# A compiled kernel takes its state as scalars, by position, and runs in one piece: numba keeps them
# in registers, and keyword arguments or a state object would cost it that.
# ruff: noqa: PLR0912, PLR0915, PLR0917
from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from analysis.model.hertz import contact_time

HSD = 0
"""Rigid cell: the output is ``gain * F_el``."""
KV = 1
"""Kelvin-Voigt crystal: the output is ``gain * Delta``."""

CONTACT_STEPS = 92
"""Steps over the contact on a rigid cell; see `contact_steps` for a ringing one."""

_STEPS_PER_RADIAN = 5.0
_STEPS_PER_SQUARE_RADIAN = 0.1
_CLOSED_STEPS_PER_SQUARE_RADIAN = 0.2
"""The dashpot's force begins like t^(1/4), and a crystal that feels it rings more by it."""
MAX_STEPS = 20_000
ENDLESS = 4
"""Times the usual steps of a contact after which it is followed only as far as it is seen."""

HOVERS = 1e-3
"""Share of its scales of depth (to the fourth root) and speed at which a sphere neither presses nor
leaves, where the solver's time would stand still."""

# Dormand & Prince's fifth-order pair (J. Comput. Appl. Math. 6 (1980) 19-26), the order-5 row.
_A21 = 1 / 5
_A31, _A32 = 3 / 40, 9 / 40
_A41, _A42, _A43 = 44 / 45, -56 / 15, 32 / 9
_A51, _A52, _A53, _A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
_A61, _A62, _A63, _A64, _A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
_B1, _B3, _B4, _B5, _B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84


@njit(cache=True, inline="always")
def _slope(y, u, D, w, Km, cd, KM, cM, w2, g2, g):  # type: ignore[no-untyped-def]
    """Return d(y, u, Delta, w, t)/ds; the masses are already divided out.

    ``cM`` is the dashpot's share in the crystal's acceleration, 0 in the paper's models.
    """
    y3 = y * y * y
    f = y3 * y3
    a = KM * f + cM * y * u - w2 * D - g2 * w
    return 0.25 * u, y3 * (g - Km * f - cd * y * u - a), y3 * w, y3 * a, y3


@njit(cache=True, inline="always")
def _step(y, u, D, w, t, h, Km, cd, KM, cM, w2, g2, g):  # type: ignore[no-untyped-def]
    """Return the state one step of size h in s later."""
    a1, b1, c1, d1, e1 = _slope(y, u, D, w, Km, cd, KM, cM, w2, g2, g)
    a2, b2, c2, d2, _ = _slope(
        y + h * _A21 * a1,
        u + h * _A21 * b1,
        D + h * _A21 * c1,
        w + h * _A21 * d1,
        Km,
        cd,
        KM,
        cM,
        w2,
        g2,
        g,
    )
    a3, b3, c3, d3, e3 = _slope(
        y + h * (_A31 * a1 + _A32 * a2),
        u + h * (_A31 * b1 + _A32 * b2),
        D + h * (_A31 * c1 + _A32 * c2),
        w + h * (_A31 * d1 + _A32 * d2),
        Km,
        cd,
        KM,
        cM,
        w2,
        g2,
        g,
    )
    a4, b4, c4, d4, e4 = _slope(
        y + h * (_A41 * a1 + _A42 * a2 + _A43 * a3),
        u + h * (_A41 * b1 + _A42 * b2 + _A43 * b3),
        D + h * (_A41 * c1 + _A42 * c2 + _A43 * c3),
        w + h * (_A41 * d1 + _A42 * d2 + _A43 * d3),
        Km,
        cd,
        KM,
        cM,
        w2,
        g2,
        g,
    )
    a5, b5, c5, d5, e5 = _slope(
        y + h * (_A51 * a1 + _A52 * a2 + _A53 * a3 + _A54 * a4),
        u + h * (_A51 * b1 + _A52 * b2 + _A53 * b3 + _A54 * b4),
        D + h * (_A51 * c1 + _A52 * c2 + _A53 * c3 + _A54 * c4),
        w + h * (_A51 * d1 + _A52 * d2 + _A53 * d3 + _A54 * d4),
        Km,
        cd,
        KM,
        cM,
        w2,
        g2,
        g,
    )
    a6, b6, c6, d6, e6 = _slope(
        y + h * (_A61 * a1 + _A62 * a2 + _A63 * a3 + _A64 * a4 + _A65 * a5),
        u + h * (_A61 * b1 + _A62 * b2 + _A63 * b3 + _A64 * b4 + _A65 * b5),
        D + h * (_A61 * c1 + _A62 * c2 + _A63 * c3 + _A64 * c4 + _A65 * c5),
        w + h * (_A61 * d1 + _A62 * d2 + _A63 * d3 + _A64 * d4 + _A65 * d5),
        Km,
        cd,
        KM,
        cM,
        w2,
        g2,
        g,
    )
    return (
        y + h * (_B1 * a1 + _B3 * a3 + _B4 * a4 + _B5 * a5 + _B6 * a6),
        u + h * (_B1 * b1 + _B3 * b3 + _B4 * b4 + _B5 * b5 + _B6 * b6),
        D + h * (_B1 * c1 + _B3 * c3 + _B4 * c4 + _B5 * c5 + _B6 * c6),
        w + h * (_B1 * d1 + _B3 * d3 + _B4 * d4 + _B5 * d5 + _B6 * d6),
        t + h * (_B1 * e1 + _B3 * e3 + _B4 * e4 + _B5 * e5 + _B6 * e6),
    )


@njit(cache=True, inline="always")
def _lift_off(y, u, D, w, t, h, Km, cd, KM, cM, w2, g2, g, end_cd):  # type: ignore[no-untyped-def]
    """Return the fraction of the step at which the contact ends.

    Newton on H of the module's text; ``end_cd`` is cd where the force ends the contact, 0 where the
    indentation does.
    """
    part = h
    for _ in range(12):
        state = _step(y, u, D, w, t, part, Km, cd, KM, cM, w2, g2, g)
        y1, u1 = state[0], state[1]
        depth, slope = 0.0, 0.25 * u1
        if end_cd > 0.0 and u1 < 0.0:
            depth = (-end_cd * u1 / Km) ** 0.2
            ahead = _slope(y1, u1, state[2], state[3], Km, cd, KM, cM, w2, g2, g)
            slope -= 0.2 * depth * ahead[1] / u1
        correction = (y1 - depth) / slope
        part -= correction
        if abs(correction) <= 1e-15 * h:
            break
    return part


@njit(cache=True, inline="always")
def _quintic(q0, v0, a0, q1, v1, a1, h):  # type: ignore[no-untyped-def]
    """Return Hermite's polynomial in x = (t - t0)/h through two values, rates, accelerations."""
    p1, p2 = v0 * h, 0.5 * a0 * h * h
    r = q1 - q0 - p1 - p2
    s = v1 * h - p1 - 2.0 * p2
    c = a1 * h * h - 2.0 * p2
    return (
        p1,
        p2,
        10.0 * r - 4.0 * s + 0.5 * c,
        -15.0 * r + 7.0 * s - c,
        6.0 * r - 3.0 * s + 0.5 * c,
    )


@njit(cache=True)
def _ring(out, first, x0, v0, t0, start, dt, w2, g2, gain):  # type: ignore[no-untyped-def]
    """Write the free ring from sample ``first`` on; exact for any damping."""
    n = out.size
    if first >= n:
        return
    half = 0.5 * g2
    disc = w2 - half * half
    t = start + first * dt - t0
    if disc > 0:
        wd = math.sqrt(disc)
        # z rotates: out = Re(z); two interleaved chains hide the latency of the product.
        a, b = x0, (v0 + half * x0) / wd
        e = math.exp(-half * t)
        c, s = math.cos(wd * t), math.sin(wd * t)
        re0 = gain * e * (a * c + b * s)
        im0 = gain * e * (b * c - a * s)
        e = math.exp(-half * dt)
        rc, rs = e * math.cos(wd * dt), e * math.sin(wd * dt)
        re1, im1 = re0 * rc + im0 * rs, im0 * rc - re0 * rs
        qc, qs = rc * rc - rs * rs, 2.0 * rc * rs
        i = first
        while i + 1 < n:
            out[i] += re0
            out[i + 1] += re1
            re0, im0 = re0 * qc + im0 * qs, im0 * qc - re0 * qs
            re1, im1 = re1 * qc + im1 * qs, im1 * qc - re1 * qs
            i += 2
        if i < n:
            out[i] += re0
        return
    root = math.sqrt(-disc)
    for i in range(first, n):
        t = start + i * dt - t0
        if root * t > 1e-8:
            shape = math.sinh(root * t) / root
            out[i] += (
                gain * math.exp(-half * t) * (x0 * math.cosh(root * t) + (v0 + half * x0) * shape)
            )
        else:
            out[i] += gain * math.exp(-half * t) * (x0 + (v0 + half * x0) * t)


@njit(cache=True, nogil=True)
def integrate(out, kind, start, dt, K, m, v0, alpha, g, M, k, mu, gain, steps, closed):  # type: ignore[no-untyped-def]
    r"""Add one impact at t = 0, sampled at ``start + i dt``, to ``out``.

    Parameters
    ----------
    out : ndarray of float64, shape (n,)
        Samples the impact is added to, in units of ``gain`` times newton (HSD) or metre (KV).
    kind : int
        `HSD` or `KV`.
    start, dt : float
        Time of the first sample relative to touch-down, and the sample interval. [s]
    K, m, v0, alpha, g : float
        Stiffness [N m^-1.5], sphere mass [kg], impact speed [m/s], Eq. 5's alpha [1],
        gravity [m/s^2].
    M, k, mu : float
        Mass on the spring (crystal, and the coupon on it) [kg], stiffness [N/m], damping [N s/m];
        unused for `HSD`.
    gain : float
        1/S [V/N] for `HSD`, 1/c [V/m] for `KV`.
    closed : bool
        The dashpot's force loads the crystal as well, and the contact ends when the total force
        does; False for the paper's models.

    Returns
    -------
    tuple of float
        Contact duration [s], sphere's rebound speed [m/s], largest indentation [m]; the duration
        is NaN when the contact did not end within the allowed steps.

    Notes
    -----
    Source: Eqs 1-11 of Maranzano & Hancock 2016; closed: Newton's third law, and Schwager &
    Poeschel 2008 for the end. Validation: ``tests/analysis/model/test_solver.py`` and
    ``test_closed.py`` against DOP853 at rtol 1e-12.
    """
    n = out.size
    Km = K / m
    cd = alpha * math.sqrt(Km)
    KM, cM, w2, g2 = 0.0, 0.0, 0.0, 0.0
    if kind == KV:
        KM, w2, g2 = K / M, k / M, mu / M
        if closed:
            cM = cd * m / M
    end_cd = cd if closed and cd > 0.0 else 0.0
    # a sphere that hardly moves is driven by its weight
    speed = math.sqrt(v0 * v0 + 2.0 * g * (2.5 * g / Km) ** (2.0 / 3.0))
    depth = (1.25 * speed * speed / Km) ** 0.4
    y_scale = depth**0.25
    # s over a loss-free contact is 13.05 y_max / v0 (computed once, see the tests)
    h = 13.05 * y_scale / speed / steps
    y, u, D, w, t = 0.0, v0, 0.0, 0.0, 0.0
    i = 0
    if start < 0.0:
        # a touch-down beyond the window, however far, leaves all of it untouched
        i = math.ceil(min(-start / dt - 1e-12, float(out.size)))
    ended = False
    deepest = 0.0
    count = 0
    while not ended and count < MAX_STEPS and (i < n or count < ENDLESS * steps):
        count += 1
        y1, u1, D1, w1, t1 = _step(y, u, D, w, t, h, Km, cd, KM, cM, w2, g2, g)
        if u1 < 0.0 and Km * y1**5 + end_cd * u1 <= 0.0:
            part = _lift_off(y, u, D, w, t, h, Km, cd, KM, cM, w2, g2, g, end_cd)
            y1, u1, D1, w1, t1 = _step(y, u, D, w, t, part, Km, cd, KM, cM, w2, g2, g)
            if end_cd == 0.0:
                y1 = 0.0
            ended = True
        elif y1 < HOVERS * y_scale and abs(u1) < HOVERS * speed:
            ended = True
        deepest = max(deepest, y1)
        if i < n and start + i * dt <= t1:
            length = t1 - t
            f0, f1 = y**6, y1**6
            if kind == KV:
                q0, r0, a0 = D, w, KM * f0 + cM * y * u - w2 * D - g2 * w
                q1, r1, a1 = D1, w1, KM * f1 + cM * y1 * u1 - w2 * D1 - g2 * w1
            else:
                q0, r0, a0 = y**4, u, g - Km * f0 - cd * y * u
                q1, r1, a1 = y1**4, u1, g - Km * f1 - cd * y1 * u1
            p1, p2, p3, p4, p5 = _quintic(q0, r0, a0, q1, r1, a1, length)
            while i < n:
                ti = start + i * dt
                if ti > t1:
                    break
                x = (ti - t) / length
                q = q0 + x * (p1 + x * (p2 + x * (p3 + x * (p4 + x * p5))))
                if kind == KV:
                    out[i] += gain * q
                elif q > 0.0:
                    out[i] += gain * K * q * math.sqrt(q)
                i += 1
        y, u, D, w, t = y1, u1, D1, w1, t1
    if not ended:
        return math.nan, math.nan, deepest**4
    if kind == KV:
        _ring(out, i, D, w, t, start, dt, w2, g2, gain)
    return t, -(u + w), deepest**4


def contact_steps(omega0_rad_per_s: float, contact_time_s: float, *, closed: bool = False) -> int:
    """Return how many steps resolve both the contact and the crystal that rings during it.

    At least `CONTACT_STEPS`. ``omega0_rad_per_s`` is 0 for a rigid cell.

    Notes
    -----
    Chosen so that the largest error against DOP853 at rtol 1e-12 stays below 1e-6 of the peak for
    ``omega0 * contact_time`` from 0 to 60 and damping ratios from 0.01
    (``tests/analysis/model/test_solver.py``, ``test_closed.py``). Against four times the steps 3000
    random closed impacts are at most 7e-7 off.
    """
    phase = omega0_rad_per_s * contact_time_s
    square = _CLOSED_STEPS_PER_SQUARE_RADIAN if closed else _STEPS_PER_SQUARE_RADIAN
    return math.ceil(CONTACT_STEPS + _STEPS_PER_RADIAN * phase + square * phase**2)


def trace(
    *,
    kind: int,
    sample_times_start_s: float,
    sample_interval_s: float,
    samples: int,
    stiffness: float,
    mass_kg: float,
    speed_m_per_s: float,
    alpha: float,
    gravity_m_per_s2: float = 9.80665,
    crystal_mass_kg: float = math.nan,
    crystal_stiffness_n_per_m: float = math.nan,
    crystal_damping_n_s_per_m: float = math.nan,
    gain: float = 1.0,
    steps: int | None = None,
    closed: bool = False,
) -> tuple[NDArray[np.float64], float, float, float]:
    """Return one sampled impact; `integrate` with named parameters.

    Parameters
    ----------
    kind : int
        `HSD` or `KV`.
    sample_times_start_s : float
        First sample relative to touch-down. [s]
    stiffness, mass_kg, speed_m_per_s, alpha, gravity_m_per_s2 : float
        K [N m^-1.5], m [kg], v0 [m/s], alpha [1], g [m/s^2].
    crystal_mass_kg, crystal_stiffness_n_per_m, crystal_damping_n_s_per_m : float
        M, k, mu; needed for `KV`.
    gain : float
        1/S or 1/c, see `integrate`.
    steps : int, optional
        Steps over the contact; by default what `contact_steps` says.
    closed : bool
        See `integrate`; ``crystal_mass_kg`` then holds the coupon's mass too.

    Returns
    -------
    signal : ndarray, shape (samples,)
        In units of ``gain`` times newton (HSD) or metre (KV).
    """
    out = np.zeros(samples)
    if steps is None:
        omega0 = math.sqrt(crystal_stiffness_n_per_m / crystal_mass_kg) if kind == KV else 0.0
        duration = contact_time(stiffness, mass_kg, speed_m_per_s)
        steps = contact_steps(omega0, duration, closed=closed)
    duration, rebound, deepest = integrate(
        out,
        kind,
        sample_times_start_s,
        sample_interval_s,
        stiffness,
        mass_kg,
        speed_m_per_s,
        alpha,
        gravity_m_per_s2,
        crystal_mass_kg,
        crystal_stiffness_n_per_m,
        crystal_damping_n_s_per_m,
        gain,
        steps,
        closed,
    )
    return out, duration, rebound, deepest
