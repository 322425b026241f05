r"""The impact with any contact law and any structure, compiled once for all combinations.

Same change of variable as ``analysis.model.solver`` (y = delta^(1/4), dt = y^3 ds). Contact effects
are compiled functions of one signature, handed over as a tuple; which of them act, and with which
numbers, is data. So no combination compiles anew, and the base model does not come this way at all.

A contact term is called as ``term(delta, rate, elastic, z, p0, p1, p2, p3)`` with the indentation
[m], its rate [m/s], Hertz's force K delta^(3/2) [N], its own memory z, and its packed parameters.
It returns ``(elastic_addition [N], dissipative_addition [N], dz/dt, recession [m/s])``: the elastic
part also loads the structure, the dissipative part only the sphere (the paper's convention), and the
recession is taken from the indentation rate.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from numba import float64, njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning

from analysis.model.solver import _MAX_STEPS, _quintic

# functions as values are "experimental" in numba's words; the tests pin what is used of them
warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)

TERM = types.UniTuple(float64, 4)(
    float64, float64, float64, float64, float64, float64, float64, float64
)
"""Signature of a contact term."""

# state: y, u, t, then one memory per term, then the structure
_Y, _U, _T, _Z = 0, 1, 2, 3


@njit(cache=True)
def _forces(state, K, cd, share, terms, active, packed):  # type: ignore[no-untyped-def]
    """Return (elastic, dissipative, recession) and leave dz/dt in ``packed``'s last column."""
    y = max(state[_Y], 0.0)
    delta = y * y * y * y
    elastic = K * delta * y * y
    total, lost, recession = elastic, cd * y * state[_U], 0.0
    for j in active:
        p = packed[j]
        e, d, z, r = terms[j](delta, state[_U], elastic, state[_Z + j], p[0], p[1], p[2], p[3])
        total += e
        lost += d
        recession += r
        packed[j, 4] = z
    return total, lost, recession


@njit(cache=True)
def _rates(out, state, K, m, cd, g, share, terms, active, packed, A, b, top):  # type: ignore[no-untyped-def]
    """Write d(state)/ds and return the force on the structure."""
    n_terms = len(terms)
    elastic, lost, recession = _forces(state, K, cd, share, terms, active, packed)
    y = state[_Y]
    y3 = y * y * y
    load = elastic + share * lost
    first = _Z + n_terms
    n = b.size
    for i in range(n):
        rate = b[i] * load
        for j in range(n):
            rate += A[i, j] * state[first + j]
        out[first + i] = rate
    acceleration = out[first + top + 1] if n else 0.0
    out[_Y] = 0.25 * (state[_U] - recession)
    out[_U] = y3 * (g - (elastic + lost) / m - acceleration)
    out[_T] = y3
    for j in range(n_terms):
        out[_Z + j] = 0.0
    for j in active:
        out[_Z + j] = y3 * packed[j, 4]
    for i in range(n):
        out[first + i] *= y3
    return load


@njit(cache=True)
def _advance(new, state, k, work, h, K, m, cd, g, share, terms, active, packed, A, b, top):  # type: ignore[no-untyped-def]
    """Write the state one step of size h in s later (Dormand & Prince, order 5)."""
    size = state.size
    _rates(k[0], state, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        work[i] = state[i] + h * (1 / 5) * k[0, i]
    _rates(k[1], work, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        work[i] = state[i] + h * (3 / 40 * k[0, i] + 9 / 40 * k[1, i])
    _rates(k[2], work, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        work[i] = state[i] + h * (44 / 45 * k[0, i] - 56 / 15 * k[1, i] + 32 / 9 * k[2, i])
    _rates(k[3], work, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        work[i] = state[i] + h * (
            19372 / 6561 * k[0, i]
            - 25360 / 2187 * k[1, i]
            + 64448 / 6561 * k[2, i]
            - 212 / 729 * k[3, i]
        )
    _rates(k[4], work, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        work[i] = state[i] + h * (
            9017 / 3168 * k[0, i]
            - 355 / 33 * k[1, i]
            + 46732 / 5247 * k[2, i]
            + 49 / 176 * k[3, i]
            - 5103 / 18656 * k[4, i]
        )
    _rates(k[5], work, K, m, cd, g, share, terms, active, packed, A, b, top)
    for i in range(size):
        new[i] = state[i] + h * (
            35 / 384 * k[0, i]
            + 500 / 1113 * k[2, i]
            + 125 / 192 * k[3, i]
            - 2187 / 6784 * k[4, i]
            + 11 / 84 * k[5, i]
        )


@njit(cache=True)
def _propagator(A, dt):  # type: ignore[no-untyped-def]
    """Return expm(A dt) by scaling and squaring of a Taylor series."""
    n = A.shape[0]
    norm = 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += abs(A[i, j]) * dt
        norm = max(norm, row)
    squarings = 0
    if norm > 0.25:
        squarings = int(math.ceil(math.log2(norm / 0.25)))
    X = A * (dt / 2.0**squarings)
    E = np.eye(n)
    term = np.eye(n)
    for i in range(1, 13):
        term = term @ X / i
        E = E + term
    for _ in range(squarings):
        E = E @ E
    return E


@njit(cache=True)
def _ring(out, i, s, P, reading, gain):  # type: ignore[no-untyped-def]
    """Write the structure's free motion from sample ``i`` on; P is the propagator of one sample."""
    ns = s.size
    other = np.empty(ns)
    for j in range(i, out.size):
        value = 0.0
        for row in range(ns):
            value += reading[row] * s[row]
        out[j] += gain * value
        for row in range(ns):
            total = 0.0
            for col in range(ns):
                total += P[row, col] * s[col]
            other[row] = total
        for row in range(ns):
            s[row] = other[row]


@njit(cache=True)
def integrate_with_effects(
    out, start, dt, K, m, v0, alpha, g, share, terms, active, packed, A, b, reading, top, gain, steps
):  # type: ignore[no-untyped-def]
    r"""Add one impact at t = 0, sampled at ``start + i dt``, to ``out``.

    Parameters
    ----------
    out : ndarray of float64, shape (n,)
        Samples the impact is added to.
    start, dt : float
        First sample relative to touch-down, sample interval. [s]
    K, m, v0, alpha, g : float
        As in ``analysis.model.solver.integrate``.
    share : float
        Part of the dissipative force that also loads the structure. [1]
    terms : tuple of compiled functions
        All contact terms of the library, in its order.
    active : ndarray of int64, shape (a,)
        Which of them act.
    packed : ndarray of float64, shape (len(terms), 5)
        Four numbers a term, and a place to work in.
    A, b, reading, top : ndarray, ndarray, ndarray, int
        The structure, see ``analysis.model.structure``; empty arrays for a rigid cell, whose output
        is the elastic force.
    gain : float
        Output per metre of crystal compression, or per newton for a rigid cell.
    steps : int
        Steps over the contact.

    Returns
    -------
    tuple of float
        Contact duration [s], sphere's rebound speed [m/s], largest indentation [m]; the duration
        is NaN when the contact did not end within the allowed steps.
    """
    n, ns, n_terms = out.size, b.size, len(terms)
    size = _Z + n_terms + ns
    first = _Z + n_terms
    state, new, work, rate = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    k = np.zeros((6, size))
    state[_U] = v0
    cd = alpha * math.sqrt(m * K)
    depth = (1.25 * m * v0 * v0 / K) ** 0.4
    h = 13.05 * depth**0.25 / v0 / steps
    i = 0
    if start < 0.0:
        i = int(math.ceil(-start / dt - 1e-12))
    f0 = _rates(rate, state, K, m, cd, g, share, terms, active, packed, A, b, top)
    ended, deepest = False, 0.0
    for _ in range(_MAX_STEPS):
        _advance(new, state, k, work, h, K, m, cd, g, share, terms, active, packed, A, b, top)
        if new[_Y] <= 0.0 and new[_U] < 0.0:
            part = h
            for _ in range(12):
                _advance(
                    new, state, k, work, part, K, m, cd, g, share, terms, active, packed, A, b, top
                )
                correction = 4.0 * new[_Y] / new[_U]
                part -= correction
                if abs(correction) <= 1e-14 * h:
                    break
            _advance(new, state, k, work, part, K, m, cd, g, share, terms, active, packed, A, b, top)
            new[_Y] = 0.0
            ended = True
        deepest = max(deepest, new[_Y])
        f1 = _rates(rate, new, K, m, cd, g, share, terms, active, packed, A, b, top)
        t0, t1 = state[_T], new[_T]
        if i < n and start + i * dt <= t1:
            q0 = q1 = r0 = r1 = s0 = s1 = 0.0
            if ns:
                for row in range(ns):
                    if reading[row] == 0.0:
                        continue
                    c = reading[row]
                    q0 += c * state[first + row]
                    q1 += c * new[first + row]
                    r0 += c * state[first + row + 1]
                    r1 += c * new[first + row + 1]
                    x0, x1 = b[row + 1] * f0, b[row + 1] * f1
                    for col in range(ns):
                        x0 += A[row + 1, col] * state[first + col]
                        x1 += A[row + 1, col] * new[first + col]
                    s0 += c * x0
                    s1 += c * x1
                p1, p2, p3, p4, p5 = _quintic(q0, r0, s0, q1, r1, s1, t1 - t0)
            else:
                # contact laws differ, so the force itself is interpolated, linearly
                q0, p1, p2, p3, p4, p5 = f0, f1 - f0, 0.0, 0.0, 0.0, 0.0
            while i < n:
                ti = start + i * dt
                if ti > t1:
                    break
                x = (ti - t0) / (t1 - t0)
                q = q0 + x * (p1 + x * (p2 + x * (p3 + x * (p4 + x * p5))))
                out[i] += gain * q
                i += 1
        state[:] = new
        f0 = f1
        if ended:
            break
        if not (math.isfinite(state[_Y]) and math.isfinite(state[_U])):
            break
    if not ended:
        return math.nan, math.nan, deepest**4
    surface = state[first + top + 1] if ns else 0.0
    if ns and i < n:
        s = _propagator(A, start + i * dt - state[_T]) @ state[first:]
        _ring(out, i, s, _propagator(A, dt), reading, gain)
    return state[_T], -(state[_U] + surface), deepest**4
