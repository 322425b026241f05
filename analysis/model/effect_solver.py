r"""The impact with any contact law and any structure, compiled once for all combinations.

Same change of variable as ``analysis.model.solver`` (y = delta^(1/4), dt = y^3 ds). Contact effects
are compiled functions of one signature, handed over as a list; which of them act, and with which
numbers, is data. So no combination compiles anew, and the base model does not come this way at all.

A contact term is called as ``term(delta, rate, elastic, z, p0, p1, p2, p3)`` with the indentation
[m], its rate [m/s], Hertz's force K delta^(3/2) [N], its own memory z, and its packed parameters.
It returns ``(elastic_addition [N], dissipative_addition [N], dz/dt, recession [m/s])``: the elastic
part also loads the structure, the dissipative part only the sphere (the paper's convention); the
recession is taken from the indentation rate. A closed base model loads the structure with both, and
its contact ends when their sum does. On the paper's base models it ends with the indentation, or
with the elastic part where an effect's could pull (``Effect.parts_by_force``). Where surfaces hold
on to one another a contact ends only ``reach`` beyond the plane in which it began; there the
indentation is negative, and neither Hertz's force nor the base dashpot acts.

A call integrates a whole set of columns: a trace and its neighbours, each with its own numbers.

The sphere touches once: what swings after lift-off is taken never to catch it up again. A coupon
of mass m_c that takes the whole push before its tape answers returns at (1 + e) m v / (m + m_c) at
most, the sphere leaves at (e m_c - m) v / (m + m_c): it is safe from m_c = (2 + e) / e m, some four
times the sphere's mass, and lighter ones are on all but the softest tapes
(``tests/analysis/model/test_one_contact.py``).

The work array is what makes it fast. The states lie in blocks of eight, each block with all its
Runge-Kutta stages behind one another at fixed distances, so that a stage's combination is a few
vector instructions whatever the number of states.
"""

# One compiled unit: splitting it further would pass a dozen scalars around for nothing.
# ruff: noqa: PLR0912, PLR0915, PLR0917

from __future__ import annotations

import math

import numpy as np
from numba import float64, njit, types

from analysis.model.by_address import call_term, load, store
from analysis.model.free_ring import add_free_ring, carry_on
from analysis.model.solver import ENDLESS, HOVERS, MAX_STEPS, _quintic

TERM = types.UniTuple(float64, 4)(  # type: ignore[no-untyped-call]
    float64, float64, float64, float64, float64, float64, float64, float64
)
"""Signature of a contact term."""

NUMBERS = (
    "start", "dt", "K", "m", "v0", "alpha", "g", "share", "mobility", "gain", "reach", "bears",
    "counted",
)  # fmt: skip
"""What a column's row of numbers holds, see `integrate_columns`."""

# state: y, u, t, then one memory per acting term, then the structure
_Y, _U, _T, _Z = 0, 1, 2, 3

# the work array: blocks of eight states, each with the rows state, trial, k1 ... k7
_LANES = 8
_STATE, _TRIAL, _K = 0, 1, 2
_ROWS = 9
_STAGES = 7
_BLOCK = _LANES * _ROWS

# Dormand & Prince's order-5 row, as in the base solver; its slope at the end is the next step's
# first. A table: one place in the code calls the laws, which the compiler can then take apart.
_TABLE = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_RATE_TOLERANCE = 1e-11
"""Of the impact speed: how well the indentation rate on a receding ground is solved for."""


_ROUNDING = 1e-14
"""Of a fourth root's fourth power. Derived: two roots and two squares are off by 9 half units in
the last place, 1e-15, at most; ten times that."""
_FLOOR = 1e-6
"""Of its scale of depth (to the fourth root), where a force over y is taken for its limit."""
_MOST_CORRECTIONS = 60
"""Bisection alone needs 47 to 1e-14 of a step."""


@njit(cache=True, nogil=True, inline="always")
def _gap(y, u, force, K, cd, floor):  # type: ignore[no-untyped-def]
    """Return H of ``analysis.model.solver`` for any law: its sign is the force's, its zero simple.

    ``force`` is the one that ends the contact, and what the surfaces bear; ``cd`` is the base
    dashpot's coefficient as far as it is part of that.
    """
    rest = force / (K * y) - y**5 if y > floor else cd * u / K + force / (K * floor)
    return y - max(-rest, 0.0) ** 0.2


@njit(cache=True, nogil=True, inline="always")
def _at(i):  # type: ignore[no-untyped-def]
    """Return where state i lies in the first row of its block."""
    return (i >> 3) * _BLOCK + (i & 7)


@njit(cache=True, nogil=True, fastmath={"contract"})
def _forces(work, row, k, y3, K, cd, mobility, reach, v0, count, terms, packed):  # type: ignore[no-untyped-def]
    """Return (elastic, dissipative, recession) and write the memories' slopes."""
    y = max(load(work, row + _Y), 0.0)
    u = load(work, row + _U)
    delta = y * y * y * y - reach
    if reach != 0.0:
        if abs(delta) < _ROUNDING * reach:  # at touch-down; the fourth root of it is not small
            delta = 0.0
        y = math.sqrt(math.sqrt(max(delta, 0.0)))
    elastic = K * y * y * y * y * y * y
    drag = cd * y
    # without terms the rate that the receding ground leaves is a closed form
    yielding, rate = 1.0, u
    if mobility != 0.0:
        yielding = 1.0 / (1.0 + mobility * drag)
        rate = (u - mobility * elastic) * yielding
    if count == 0:
        return elastic, drag * rate, u - rate
    total, lost, receding = 0.0, 0.0, 0.0
    last_rate, last_miss = 0.0, 0.0
    for trial in range(8):
        total, lost, receding = elastic, drag * rate, 0.0
        for a in range(count):
            p = 4 * a
            e, d, z, r = call_term(
                terms, a, delta, rate, elastic, load(work, _at(_Z + a) + row),
                load(packed, p), load(packed, p + 1), load(packed, p + 2), load(packed, p + 3),
            )  # fmt: skip
            total += e
            lost += d
            receding += r
            store(work, _at(_Z + a) + k, y3 * z)
        receding += mobility * (total + lost)
        miss = u - receding - rate
        if abs(miss) <= _RATE_TOLERANCE * v0:
            break
        moved = rate + miss * yielding
        if trial > 0 and miss != last_miss:
            moved = rate - miss * (rate - last_rate) / (miss - last_miss)
        last_rate, last_miss = rate, miss
        rate = moved
    return total, lost, receding


@njit(cache=True, nogil=True, fastmath={"contract"})
def _advance(  # type: ignore[no-untyped-def]
    work,
    begin,
    end,
    h,
    K,
    cd,
    mobility,
    reach,
    v0,
    per_mass,
    g,
    share,
    counted,
    count,
    terms,
    packed,
    masses,
    A,
    b,
    top,
):
    """Write the trial one step of size h in s after the state, and its slope, by stages.

    Stage 0 writes the slope of the state itself, which a later step inherits from the one before.
    Returns the force on the structure and the one whose end may be the contact's.
    """
    first = _Z + count
    blocks = (first + 2 * masses + _LANES - 1) // _LANES
    row, force, parting = _TRIAL * _LANES, 0.0, 0.0
    for stage in range(begin, end):
        c1, c2, c3 = h * _TABLE[stage, 0], h * _TABLE[stage, 1], h * _TABLE[stage, 2]
        c4, c5, c6 = h * _TABLE[stage, 3], h * _TABLE[stage, 4], h * _TABLE[stage, 5]
        for block in range(blocks):
            for lane in range(_LANES):
                i = block * _BLOCK + lane
                change = (
                    c1 * load(work, i + (_K + 0) * _LANES)
                    + c2 * load(work, i + (_K + 1) * _LANES)
                    + c3 * load(work, i + (_K + 2) * _LANES)
                    + c4 * load(work, i + (_K + 3) * _LANES)
                    + c5 * load(work, i + (_K + 4) * _LANES)
                    + c6 * load(work, i + (_K + 5) * _LANES)
                )
                store(work, i + _TRIAL * _LANES, load(work, i) + change)
        k = (_K + stage) * _LANES
        y = load(work, row + _Y)
        y3 = y * y * y
        elastic, lost, recession = _forces(
            work, row, k, y3, K, cd, mobility, reach, v0, count, terms, packed
        )
        force = elastic + share * lost
        parting = elastic + counted * lost
        acceleration = 0.0
        for i in range(masses):
            rate = load(b, i) * force
            for j in range(2 * masses):
                rate += load(A, 2 * masses * i + j) * load(work, _at(first + j) + row)
            if i == top:
                acceleration = rate
            w = load(work, _at(first + 2 * i + 1) + row)
            store(work, _at(first + 2 * i) + k, y3 * w)
            store(work, _at(first + 2 * i + 1) + k, y3 * rate)
        store(work, k + _Y, 0.25 * (load(work, row + _U) - recession))
        store(work, k + _U, y3 * (g - (elastic + lost) * per_mass - acceleration))
        store(work, k + _T, y3)
    return force, parting


@njit(cache=True, nogil=True, inline="always")
def _cubic(a, da, b, db, x):  # type: ignore[no-untyped-def]
    """Return Hermite's cubic on [0, 1] through two values and slopes."""
    d = b - a
    return a + x * (da + x * (3.0 * d - 2.0 * da - db + x * (da + db - 2.0 * d)))


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True)
def _force_at(  # type: ignore[no-untyped-def]
    ti, work, spare, h, K, cd, share, mobility, reach, v0, count, terms, packed
):
    """Return the force at time ``ti`` within a step, by the laws themselves at the state there.

    The states are smooth in s where the force in time is not, so they are what is interpolated.
    """
    new, before, after = _TRIAL * _LANES, _K * _LANES, (_K + 6) * _LANES
    d0, d1 = h * load(work, before + _T), h * load(work, after + _T)
    x = _fraction_at(ti, load(work, _T), d0, load(work, new + _T), d1)
    for state in range(_Z + count):
        i = _at(state)
        d0, d1 = h * load(work, before + i), h * load(work, after + i)
        store(spare, i, _cubic(load(work, i), d0, load(work, new + i), d1, x))
    elastic, lost, _ = _forces(
        spare, 0, before, 0.0, K, cd, mobility, reach, v0, count, terms, packed
    )
    return elastic + share * lost


@njit(cache=True, nogil=True, fastmath={"contract"})
def _reading_at(work, row, first, force, masses, A, b, reading):  # type: ignore[no-untyped-def]
    """Return what the cell reads in a row of the work array, its rate and its acceleration."""
    q = r = s = 0.0
    for i in range(masses):
        c = load(reading, i)
        if c != 0.0:
            q += c * load(work, _at(first + 2 * i) + row)
            r += c * load(work, _at(first + 2 * i + 1) + row)
            rate = load(b, i) * force
            for j in range(2 * masses):
                rate += load(A, 2 * masses * i + j) * load(work, _at(first + j) + row)
            s += c * rate
    return q, r, s


@njit(cache=True, nogil=True, fastmath={"contract"})
def _integrate(  # type: ignore[no-untyped-def]
    out, numbers, count, terms, packed, masses, A, b, reading, top, steps, work, spare, state
):
    """Add the contact to ``out``; all but ``out`` and ``numbers`` are counts and addresses.

    Returns lift-off [s], the sphere's rebound speed [m/s], the largest indentation [m] and the
    first sample after lift-off; the state at lift-off stays in ``work``.
    """
    start, dt, K, m, v0 = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    alpha, g, share, mobility, gain = numbers[5], numbers[6], numbers[7], numbers[8], numbers[9]
    reach, bears, counted = numbers[10], numbers[11], numbers[12]
    n, first = out.size, _Z + count
    blocks = (first + 2 * masses + _LANES - 1) // _LANES
    for i in range(blocks * _BLOCK):
        store(work, i, 0.0)
    store(work, _Y, math.sqrt(math.sqrt(reach)))
    store(work, _U, v0)
    for j in range(2 * masses):
        store(work, _at(first + j), state[j])
    cd, per_mass = alpha * math.sqrt(m * K), 1.0 / m
    # a sphere that hardly moves is driven by its weight
    speed = math.sqrt(v0 * v0 + 2.0 * g * (2.5 * g * m / K) ** (2.0 / 3.0))
    depth = (1.25 * m * speed * speed / K) ** 0.4
    h = 13.05 * depth**0.25 / speed / steps
    i = 0
    if start < 0.0:
        # a touch-down beyond the window, however far, leaves all of it untouched
        i = math.ceil(min(-start / dt - 1e-12, float(n)))
    new, k1, k7 = _TRIAL * _LANES, _K * _LANES, (_K + 6) * _LANES
    begin, end, corrections, ended = 0, 1, 0, False
    # where the force ends the contact: it presses after `low` of the step, and no more after `high`
    low, high, last, last_gap = 0.0, h, 0.0, 0.0
    floor, most = _FLOOR * depth**0.25, 12 if math.isinf(bears) else _MOST_CORRECTIONS
    length, f0, deepest = h, 0.0, 0.0
    for step in range(MAX_STEPS):
        if i >= n and step > ENDLESS * steps:
            break  # nobody sees whether it ever leaves
        f1, parting = _advance(
            work, begin, end, length,
            K, cd, mobility, reach, v0, per_mass, g, share, counted, count, terms, packed,
            masses, A, b, top,
        )  # fmt: skip
        if begin == 0:
            begin, end, f0 = 1, _STAGES, f1
            continue
        y1, u1 = load(work, new + _Y), load(work, new + _U)
        parts = y1 <= 0.0 or parting + bears <= 0.0
        if corrections or (parts and u1 < 0.0):
            # lift-off lies within the step: Newton for its length (dy/ds = u/4), then secants
            if math.isinf(bears):
                correction = 4.0 * y1 / u1
                ahead = length - correction
            else:
                gap = _gap(y1, u1, parting + bears, K, counted * cd, floor)
                if gap > 0.0:
                    low = length
                else:
                    high = length
                ahead = length - 4.0 * gap / u1 if u1 < 0.0 else low
                if corrections and gap != last_gap:
                    ahead = length - gap * (length - last) / (gap - last_gap)
                if not low < ahead < high:
                    ahead = 0.5 * (low + high)
                last, last_gap = length, gap
                correction = length - ahead if gap != 0.0 else 0.0
            if abs(correction) > 1e-14 * h and corrections < most:
                length = ahead
                corrections += 1
                continue
            if math.isinf(bears):
                y1 = 0.0
                store(work, new + _Y, 0.0)
            ended = True
        elif y1 < HOVERS * depth**0.25 and abs(u1) < HOVERS * speed:
            ended = True
        deepest = max(deepest, y1)
        t0, t1 = load(work, _T), load(work, new + _T)
        if i < n and start + i * dt <= t1:
            q0 = p1 = p2 = p3 = p4 = p5 = 0.0
            if masses:
                q0, r0, s0 = _reading_at(work, 0, first, f0, masses, A, b, reading)
                q1, r1, s1 = _reading_at(work, new, first, f1, masses, A, b, reading)
                p1, p2, p3, p4, p5 = _quintic(q0, r0, s0, q1, r1, s1, t1 - t0)
            while i < n:
                ti = start + i * dt
                if ti > t1:
                    break
                if masses:
                    x = (ti - t0) / (t1 - t0)
                    q = q0 + x * (p1 + x * (p2 + x * (p3 + x * (p4 + x * p5))))
                else:
                    q = _force_at(
                        ti, work, spare, length,
                        K, cd, share, mobility, reach, v0, count, terms, packed,
                    )  # fmt: skip
                out[i] += gain * q
                i += 1
        for block in range(blocks):
            for lane in range(_LANES):
                o = block * _BLOCK + lane
                store(work, o, load(work, o + new))
                store(work, o + k1, load(work, o + k7))
        f0 = f1
        if ended or not (math.isfinite(y1) and math.isfinite(u1)):
            break
    if not ended:
        return math.nan, math.nan, deepest**4 - reach, n
    surface = load(work, _at(first + 2 * top + 1)) if masses else 0.0
    return load(work, _T), -(load(work, _U) + surface), deepest**4 - reach, i


@njit(cache=True, nogil=True)
def integrate_columns(  # type: ignore[no-untyped-def]
    table, rows, numbers, terms, packed, which, systems, loads, readings, tops, steps, found,
    states, spans,
):  # fmt: skip
    r"""Add impacts at t = 0, sampled at ``start + i dt``, to rows of a table.

    Parameters
    ----------
    table : ndarray of float64, shape (r, n)
        Rows of samples.
    rows : ndarray of int64, shape (c,)
        Which row each impact is added to.
    numbers : ndarray of float64, shape (c, 13)
        In the order of `NUMBERS`. ``start``, ``dt``: first sample relative to touch-down, sample
        interval [s]. ``K``, ``m``, ``v0``, ``alpha``, ``g``: as in
        ``analysis.model.solver.integrate``. ``share``: part of the dissipative force that also
        loads the structure [1]. ``mobility``: speed at which the ground recedes per newton of the
        whole contact force [m/(N s)]. ``gain``: output per metre of crystal compression, or per
        newton for a rigid cell. ``reach``: how far beyond the plane of touch-down the contact ends
        [m]. ``bears``: the pull at which it ends before that [N]; infinite in the paper's models.
        ``counted``: part of the dissipative force that is part of that pull [1].
    terms : ndarray of int64, shape (a,)
        Addresses of the contact terms that act, see ``analysis.model.by_address.address_of``.
    packed : ndarray of float64, shape (c, a, 4)
        Their four numbers.
    which : ndarray of int64, shape (c,)
        Which of the structures below the columns stand on.
    systems, loads, readings, tops : ndarray, shape (s, q, 2 q), (s, q), (s, q), (s,)
        Structures of q masses, see ``analysis.model.structure.Assembled``; q is 0 for a rigid cell,
        whose output is the elastic force.
    found : ndarray of float64, shape (c, 3)
        Written: contact duration [s], sphere's rebound speed [m/s], largest indentation [m]; the
        duration is NaN when the contact did not end within the allowed steps.
    states : ndarray of float64, shape (c, 2 q)
        How the structure moves before the sphere comes, its ring already among the samples;
        overwritten with how it moves at lift-off. [m, m/s]
    spans : ndarray of float64, shape (c,)
        How long before touch-down it moved like that. [s]
    """
    masses, count = loads.shape[1], terms.size
    first = _Z + count
    blocks = (first + 2 * masses + _LANES - 1) // _LANES
    work, spare = np.zeros(blocks * _BLOCK), np.zeros(blocks * _BLOCK)
    state = np.zeros(2 * masses)
    for c in range(rows.size):
        s, out, own = which[c], table[rows[c]], numbers[c]
        moving = False
        for j in range(2 * masses):
            moving = moving or states[c, j] != 0.0
        state[:] = states[c]
        if moving:
            # what follows contains the old ring, which is taken off from touch-down on
            carry_on(systems[s], spans[c], state)
            states[c] = state
            i = max(0, math.ceil(min(-own[0] / own[1] - 1e-12, float(out.size))))
            add_free_ring(
                out, i, own[0] + i * own[1], own[1], systems[s], readings[s], -own[9], state
            )
            state[:] = states[c]
        duration, rebound, deepest, i = _integrate(
            out, own, count, terms.ctypes.data, packed[c].ctypes.data, masses,
            systems[s].ctypes.data, loads[s].ctypes.data, readings[s].ctypes.data, tops[s],
            steps, work.ctypes.data, spare.ctypes.data, state,
        )  # fmt: skip
        found[c, 0], found[c, 1], found[c, 2] = duration, rebound, deepest
        for j in range(2 * masses):
            state[j] = states[c, j] = work[_at(first + j)]
        if masses and i < out.size:
            ahead = own[0] + i * own[1] - duration
            add_free_ring(out, i, ahead, own[1], systems[s], readings[s], own[9], state)
    # addresses keep nothing alive
    spare[0] = work[0]
