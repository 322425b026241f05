r"""The impact with any contact law and any structure, compiled once for all combinations.

Same change of variable as ``analysis.model.solver`` (y = delta^(1/4), dt = y^3 ds). Contact effects
are compiled functions of one signature, handed over as a tuple; which of them act, and with which
numbers, is data. So no combination compiles anew, and the base model does not come this way at all.

A contact term is called as ``term(delta, rate, elastic, z, p0, p1, p2, p3)`` with the indentation
[m], its rate [m/s], Hertz's force K delta^(3/2) [N], its own memory z, and its packed parameters.
It returns ``(elastic_addition [N], dissipative_addition [N], dz/dt, recession [m/s])``: the elastic
part also loads the structure, the dissipative part only the sphere (the paper's convention); the
recession is taken from the indentation rate.
"""

# One compiled unit: splitting it further would pass a dozen scalars around for nothing.
# ruff: noqa: PLR0912, PLR0915, PLR0917

from __future__ import annotations

import math
import warnings

import numpy as np
from numba import float64, njit, types
from numba.core.errors import NumbaExperimentalFeatureWarning

from analysis.model.solver import MAX_STEPS, _quintic

# functions as values are "experimental" in numba's words; the tests pin what is used of them
warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)

TERM = types.UniTuple(float64, 4)(  # type: ignore[no-untyped-call]
    float64, float64, float64, float64, float64, float64, float64, float64
)
"""Signature of a contact term."""

# state: y, u, t, then one memory per acting term, then the structure
_Y, _U, _T, _Z = 0, 1, 2, 3

# Dormand & Prince's order-5 row, as in the base solver, here as a table: one place in the code
# calls the laws, which the compiler can then take apart
_TABLE = np.array(
    [
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)


@njit(cache=True)
def _forces(state, K, cd, mobility, terms, active, packed):  # type: ignore[no-untyped-def]
    """Return (elastic, dissipative, recession) and leave dz/dt in ``packed``'s last column."""
    y = max(state[_Y], 0.0)
    delta = y * y * y * y
    elastic = K * delta * y * y
    total, lost, recession, rate = elastic, 0.0, 0.0, state[_U]
    # where the ground recedes, the laws are asked again with the rate that is left
    for _ in range(4):
        total, lost, receding = elastic, cd * y * rate, 0.0
        for a in range(active.size):
            j = active[a]
            e, d, z, r = terms[j](
                delta, rate, elastic, state[_Z + a],
                packed[j, 0], packed[j, 1], packed[j, 2], packed[j, 3],
            )  # fmt: skip
            total += e
            lost += d
            receding += r
            packed[j, 4] = z
        receding += mobility * (total + lost)
        if abs(receding - recession) <= 1e-9 * abs(state[_U]):
            break
        recession = receding
        rate = state[_U] - recession
    return total, lost, recession


@njit(cache=True)
def _rates(out, state, K, m, cd, g, share, mobility, terms, active, packed, A, b, top):  # type: ignore[no-untyped-def]
    """Write d(state)/ds and return the force on the structure."""
    elastic, lost, recession = _forces(state, K, cd, mobility, terms, active, packed)
    y = state[_Y]
    y3 = y * y * y
    load = elastic + share * lost
    first = _Z + active.size
    acceleration = 0.0
    for i in range(b.size):
        rate = b[i] * load
        for j in range(b.size):
            rate += A[i, j] * state[first + j]
        if i == top + 1:
            acceleration = rate
        out[first + i] = y3 * rate
    out[_Y] = 0.25 * (state[_U] - recession)
    out[_U] = y3 * (g - (elastic + lost) / m - acceleration)
    out[_T] = y3
    for a in range(active.size):
        out[_Z + a] = y3 * packed[active[a], 4]
    return load


@njit(cache=True)
def _advance(new, state, k, h, K, m, cd, g, share, mobility, terms, active, packed, A, b, top):  # type: ignore[no-untyped-def]
    """Write the state one step of size h in s later (Dormand & Prince, order 5)."""
    new[:] = state
    for stage in range(6):
        _rates(k[stage], new, K, m, cd, g, share, mobility, terms, active, packed, A, b, top)
        for i in range(state.size):
            total = 0.0
            for j in range(stage + 1):
                total += _TABLE[stage, j] * k[j, i]
            new[i] = state[i] + h * total


@njit(cache=True, inline="always")
def _cubic(a, da, b, db, x):  # type: ignore[no-untyped-def]
    """Return Hermite's cubic on [0, 1] through two values and slopes."""
    d = b - a
    return a + x * (da + x * (3.0 * d - 2.0 * da - db + x * (da + db - 2.0 * d)))


@njit(cache=True)
def _fraction_at(ti, t0, d0, t1, d1):  # type: ignore[no-untyped-def]
    """Return where within a step the time is ``ti``: Newton, held within its bracket."""
    low, high, x = 0.0, 1.0, (ti - t0) / (t1 - t0)
    for _ in range(40):
        miss = _cubic(t0, d0, t1, d1, x) - ti
        if miss > 0.0:
            high = x
        else:
            low = x
        d = t1 - t0
        slope = d0 + x * (2.0 * (3.0 * d - 2.0 * d0 - d1) + 3.0 * x * (d0 + d1 - 2.0 * d))
        moved = x - miss / slope if slope > 0.0 else -1.0
        if not low <= moved <= high:
            moved = 0.5 * (low + high)
        if abs(moved - x) < 1e-13:
            break
        x = moved
    return x


@njit(cache=True)
def _force_at(  # type: ignore[no-untyped-def]
    ti, state, new, before, after, h, work, K, cd, share, mobility, terms, active, packed
):
    """Return the force at time ``ti`` within a step, by the laws themselves at the state there.

    The states are smooth in s where the force in time is not, so they are what is interpolated.
    """
    x = _fraction_at(ti, state[_T], h * before[_T], new[_T], h * after[_T])
    for i in range(state.size):
        work[i] = _cubic(state[i], h * before[i], new[i], h * after[i], x)
    elastic, lost, _ = _forces(work, K, cd, mobility, terms, active, packed)
    return elastic + share * lost


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
        squarings = math.ceil(math.log2(norm / 0.25))
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
def integrate_with_effects(  # type: ignore[no-untyped-def]
    out,
    start,
    dt,
    K,
    m,
    v0,
    alpha,
    g,
    share,
    mobility,
    terms,
    active,
    packed,
    A,
    b,
    reading,
    top,
    gain,
    steps,
):
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
    mobility : float
        Speed at which the ground recedes per newton of the whole contact force. [m/(N s)]
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
    n, ns = out.size, b.size
    first = _Z + active.size
    size = first + ns
    state, new, work = np.zeros(size), np.zeros(size), np.zeros(size)
    before, after = np.zeros(size), np.zeros(size)
    k = np.zeros((6, size))
    state[_U] = v0
    cd = alpha * math.sqrt(m * K)
    depth = (1.25 * m * v0 * v0 / K) ** 0.4
    h = 13.05 * depth**0.25 / v0 / steps
    i = 0
    if start < 0.0:
        i = math.ceil(-start / dt - 1e-12)
    f0 = _rates(before, state, K, m, cd, g, share, mobility, terms, active, packed, A, b, top)
    ended, deepest = False, 0.0
    for _ in range(MAX_STEPS):
        length = h
        _advance(new, state, k, h, K, m, cd, g, share, mobility, terms, active, packed, A, b, top)
        if new[_Y] <= 0.0 and new[_U] < 0.0:
            part = h
            for _ in range(12):
                _advance(
                    new,
                    state,
                    k,
                    part,
                    K,
                    m,
                    cd,
                    g,
                    share,
                    mobility,
                    terms,
                    active,
                    packed,
                    A,
                    b,
                    top,
                )
                correction = 4.0 * new[_Y] / new[_U]
                part -= correction
                if abs(correction) <= 1e-14 * h:
                    break
            _advance(
                new, state, k, part, K, m, cd, g, share, mobility, terms, active, packed, A, b, top
            )
            new[_Y] = 0.0
            length = part
            ended = True
        deepest = max(deepest, new[_Y])
        f1 = _rates(after, new, K, m, cd, g, share, mobility, terms, active, packed, A, b, top)
        t0, t1 = state[_T], new[_T]
        if i < n and start + i * dt <= t1:
            q0 = p1 = p2 = p3 = p4 = p5 = 0.0
            if ns:
                q1 = r0 = r1 = s0 = s1 = 0.0
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
            while i < n:
                ti = start + i * dt
                if ti > t1:
                    break
                if ns:
                    x = (ti - t0) / (t1 - t0)
                    q = q0 + x * (p1 + x * (p2 + x * (p3 + x * (p4 + x * p5))))
                else:
                    q = _force_at(
                        ti, state, new, before, after, length, work,
                        K, cd, share, mobility, terms, active, packed,
                    )  # fmt: skip
                out[i] += gain * q
                i += 1
        state[:] = new
        before[:] = after
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
