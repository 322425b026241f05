"""The simulator's compiled core: laws of contact, equations of motion, DOP853 with events.

All in one file on purpose: the compiler's disk cache watches only the file of the outermost
function, so a law kept elsewhere could be edited and the old machine code still run.
Nothing here is shared with the analysis: other integrator, other formulas, other author.

Signs: everything positive downwards; indentation ``delta = x - top - w`` positive in compression.
Equations: Maranzano & Hancock 2016 (Eq. numbers) and the sources named in each effect's file.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import DOP853

Vector = NDArray[np.float64]
_Function = TypeVar("_Function", bound=Callable[..., object])


def _compiled(function: _Function) -> _Function:
    """Return the function compiled at its first call; typed, which the bare decorator is not."""
    return cast("_Function", njit(function))


def _compiled_and_kept(function: _Function) -> _Function:
    """Return the function compiled once per machine."""
    return cast("_Function", njit(cache=True)(function))


# Butcher tableau of Hairer, Norsett & Wanner, Solving ODEs I, as scipy publishes it.
_A = np.ascontiguousarray(DOP853.A)
_B = np.ascontiguousarray(DOP853.B)
_E3 = np.ascontiguousarray(DOP853.E3)
_E5 = np.ascontiguousarray(DOP853.E5)
_D = np.ascontiguousarray(DOP853.D)
_A_EXTRA = np.ascontiguousarray(DOP853.A_EXTRA)

# Places in the parameter vector.
(
    MASS, K, ALPHA, GRAVITY, CELL_MASS, CELL_K, CELL_MU, RIGID, SHARE, COUPON_MASS, LAYER_K,
    LAYER_C, BASE_MASS, BASE_K, BASE_C, MODE_MASS, MODE_OMEGA, MODE_ZETA, IMPEDANCE, TENSION_RATIO,
    LAW, LAW_VALUE, RADIUS, E_STAR, RECONTACT_AT, RECONTACT_SPEED, MODE_STRETCHED, HARDENING,
    RUBBING, LAYER_HARDENING, INNER_SHARE, INNER_OMEGA, INNER_ZETA, DAMPING_GROWTH, BASE_FRICTION,
    REACTION, LIFT_OFF_RULE, LOSS_LAW, PARAMETERS,
) = range(39)  # fmt: skip
# Base laws of the elastic force.
HERTZ, YIELDING, JKR, DMT = range(4)
# Base laws of the loss; ALPHA holds the coefficient of the one that acts.
TSUJI, KUWABARA_KONO_LOSS, HUNT_CROSSLEY_LOSS = range(3)
# Where a contact without adhesion ends: indentation back at zero, or no force left.
AT_INDENTATION, AT_FORCE = range(2)
# Additional terms.
THICKNESS, ROUGHNESS, KUWABARA_KONO, HUNT_CROSSLEY, RELAXATION, RATE_POWER, FILM = range(1, 8)
SECOND_SPOT, SNAP, POWER, SOFT_TOE, LAYER, ASPERITIES = range(8, 14)
SNAP_SPEED_M_PER_S = 0.02  # over which a snap on the way in turns into none on the way out
RUBBING_SPEED_M_PER_S = 1e-4  # over which friction turns round
SLIDING_SPEED_M_PER_S = 3e-6  # the same below the cell, where all is slower
LEAST_STIFFNESS = 0.05  # of a softening seat, over that at rest
# Of the force of contact where its law gives the indentation: 2^-60 is less than the rounding of a
# double, 2^-53.
HALVINGS = 60
LEAST_DEPTH_M = 1e-9  # a power of the indentation is flat below it
TERMS = 6  # as many contact terms may act at once, each with one state of its own
VALUES = 10  # as many numbers a term may have
# Places in the state: sphere, crystal top, coupon, base, side oscillator, plate, the sphere's
# inner mass, then the terms.
_X, _V, _U, _UD, _Y, _YD, _BS, _BSD, _Q, _QD, _W, _I, _ID, _Z = range(14)
_N = _Z + TERMS
# States in the error's norm. Fewer than there are: the number belongs to the step control, and with
# another one the same seed would no longer give the same record to the last bit.
_NORM = 17
# Places in the summary.
(
    STATUS, REBOUND, LIFT_OFF, FORCE_PEAK, INDENTATION_PEAK, COMPRESSION_PEAK, END, STEPS,
    LIFT_OFF_FORCE, LIFT_OFF_DEPTH, LIFT_OFF_PLACE, SUMMARY,
) = range(12)  # fmt: skip
OK, TOO_MANY_STEPS, NEVER_LEFT = range(3)
# Kinds of event.
_LEAVES, _TOUCHES, _TURNS, _DEEPER_THAN_EVER = range(4)
_MAX_STEPS = 400_000
_LONGEST_STEP_S = 10e-6
_QUIET_S = 6e-4


@_compiled
def _jkr_force(delta: float, p: Vector) -> float:
    # Johnson, Kendall & Roberts 1971; W = 2 gamma. Newton from the right of a convex function.
    R, E, W = p[RADIUS], p[E_STAR], p[LAW_VALUE]
    a_off = (0.25 * R * math.sqrt(2.0 * math.pi * W / E)) ** (2.0 / 3.0)
    if delta <= -3.0 * a_off * a_off / R:
        a = a_off
    else:
        a = math.sqrt(R * max(delta, 0.0)) + 2.0 * (2.0 * math.pi * W * R * R / E) ** (1.0 / 3.0)
        for _ in range(60):
            g = a * a / R - math.sqrt(2.0 * math.pi * W * a / E) - delta
            slope = 2.0 * a / R - 0.5 * math.sqrt(2.0 * math.pi * W / (E * a))
            if slope <= 0.0:
                a = a_off
                break
            step = g / slope
            a = max(a - step, a_off)
            if abs(step) < 1e-14 * a:
                break
    return float(4.0 * E * a**3 / (3.0 * R) - math.sqrt(8.0 * math.pi * W * E * a**3))


@_compiled
def _release_indentation(p: Vector, memory: Vector) -> float:
    # Where contact ends: back at zero, at the dent's floor, or where the neck snaps.
    if p[LAW] == YIELDING and memory[0] > 0.0:
        return float(memory[3])
    if p[LAW] == JKR:
        a = (0.25 * p[RADIUS] * math.sqrt(2.0 * math.pi * p[LAW_VALUE] / p[E_STAR])) ** (2.0 / 3.0)
        return float(-3.0 * a * a / p[RADIUS])
    return 0.0


@_compiled
def _yield_indentation(p: Vector) -> float:
    a = math.pi * p[LAW_VALUE] * p[RADIUS] / (2.0 * p[E_STAR])
    return float(a * a / p[RADIUS])


@_compiled
def _law(delta: float, p: Vector, memory: Vector) -> float:
    d = max(delta, 0.0)
    if p[LAW] == JKR:
        return _jkr_force(delta, p)
    if p[LAW] == DMT:
        return float(p[K] * d * math.sqrt(d) - 2.0 * math.pi * p[LAW_VALUE] * p[RADIUS])
    if p[LAW] == YIELDING:
        if memory[0] > 0.0:
            return float(memory[2] * max(delta - memory[3], 0.0) ** 1.5)
        dy = _yield_indentation(p)
        if d > dy:
            return float(p[K] * dy**1.5 + 1.5 * p[K] * math.sqrt(dy) * (d - dy))
    return float(p[K] * d * math.sqrt(d))


@_compiled
def _begin_unloading(delta: float, p: Vector, memory: Vector) -> None:
    # Thornton 1997: unloading along a Hertz curve of a flattened radius.
    dy = _yield_indentation(p)
    memory[1] = delta
    memory[0] = 1.0
    if delta <= dy:
        memory[2], memory[3] = p[K], 0.0
        return
    top = p[K] * dy**1.5 + 1.5 * p[K] * math.sqrt(dy) * (delta - dy)
    at_yield = p[K] * dy**1.5
    area = ((2.0 * top + at_yield) / (2.0 * math.pi * p[LAW_VALUE])) ** 1.5
    radius = 4.0 * p[E_STAR] / (3.0 * top) * area
    memory[2] = 4.0 / 3.0 * p[E_STAR] * math.sqrt(radius)
    memory[3] = delta - (top / memory[2]) ** (2.0 / 3.0)


@_compiled
def _force_on_asperities(depth: float, stiffness: float, height: float, first: float) -> float:
    """Return the force that presses bulk and asperities in by a depth. [N]"""
    low, high = 0.0, stiffness * depth * math.sqrt(depth)
    for _ in range(HALVINGS):
        force = 0.5 * (low + high)
        if (force / stiffness) ** (2.0 / 3.0) + height * math.log1p(force / first) > depth:
            high = force
        else:
            low = force
    return low


@_compiled
def _forces(  # noqa: PLR0917, PLR0912 - compiled code knows no keywords; one branch a law
    delta: float,
    rate: float,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    s: Vector,
    memory: Vector,
) -> tuple[float, float]:
    """Return the force on the crystal and the force on the sphere alone. [N]"""
    d = max(delta, 0.0)
    root = math.sqrt(d)
    elastic = _law(delta, p, memory)
    above = max(delta - (memory[3] if memory[0] > 0.0 else 0.0), 0.0)
    if p[LOSS_LAW] == KUWABARA_KONO_LOSS:
        loss = 1.5 * p[ALPHA] * p[K] * math.sqrt(above) * rate
    elif p[LOSS_LAW] == HUNT_CROSSLEY_LOSS:
        loss = p[ALPHA] * p[K] * above * math.sqrt(above) * rate
    else:
        loss = p[ALPHA] * math.sqrt(p[MASS] * p[K]) * math.sqrt(math.sqrt(above)) * rate
    factor, added = 1.0, 0.0
    for i in range(TERMS):
        code = codes[i]
        if code == 0:
            break
        a, b, c = values[i, 0], values[i, 1], values[i, 2]
        if code == THICKNESS:
            X = math.sqrt(p[RADIUS] * d) / a
            factor *= 1.0 + X * (1.133 + X * (1.283 + X * (0.769 + X * 0.0975)))
        elif code == ROUGHNESS:
            factor *= -math.expm1(-d / a)
        elif code == KUWABARA_KONO:
            loss += 1.5 * a * p[K] * root * rate
        elif code == HUNT_CROSSLEY:
            loss += a * p[K] * d * root * rate
        elif code == RELAXATION:
            added += a * p[K] * (d * root - s[_Z + i])
        elif code == RATE_POWER:
            factor *= 1.0 + a * ((rate / b) ** 2 + 1e-4) ** (0.5 * c)
        elif code == FILM:
            squeeze = a * math.exp(-d / b) * rate
            added += squeeze if rate > 0.0 else c * squeeze
        elif code == SECOND_SPOT:
            deeper = max(d - b, 0.0)
            added += a * p[K] * deeper * math.sqrt(deeper)
        elif code == SNAP:
            closing = 0.5 * (1.0 + math.tanh(rate / SNAP_SPEED_M_PER_S))
            factor *= 1.0 - a * closing * math.exp(-(((d - b) / c) ** 2))
        elif code == POWER:
            factor *= (max(d, LEAST_DEPTH_M) / b) ** a
        elif code == SOFT_TOE:
            factor *= 1.0 - a * math.exp(-d / b)
        elif code == LAYER:
            X = math.sqrt(p[RADIUS] * d) / a
            stiffer = 0.0
            for j in range(VALUES - 1, 1, -1):
                stiffer = (stiffer + values[i, j]) * X
            factor *= (1.0 + stiffer) / (1.0 + (1.0 - b) * stiffer)
        elif code == ASPERITIES and d > 0.0:
            factor *= _force_on_asperities(d, p[K], a, b) / (p[K] * d * root)
    return elastic * factor + added, loss


@_compiled
def _relaxing_towards(  # noqa: PLR0917 - compiled code knows no keywords
    delta: float, touching: bool, p: Vector, codes: NDArray[np.int64], values: Vector, s: Vector
) -> float:
    """Return delta^(3/2) that relaxing arms follow: the indentation, or the free surface's own."""
    if touching:
        d = max(delta, 0.0)
        return d * math.sqrt(d)
    if p[LIFT_OFF_RULE] == AT_INDENTATION:
        return 0.0
    # Free of force, e + sum g (e - z) = 0: the dent left behind comes back as its arms relax.
    held, strength = 0.0, 1.0
    for i in range(TERMS):
        if codes[i] == RELAXATION:
            held += values[i, 0] * s[_Z + i]
            strength += values[i, 0]
    return held / strength


@_compiled
def _motion(  # noqa: PLR0917, PLR0915 - compiled code knows no keywords; one block a body
    s: Vector,
    touching: bool,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    memory: Vector,
    ds: Vector,
) -> float:
    top, top_rate = (s[_Y], s[_YD]) if p[COUPON_MASS] > 0.0 else (s[_U], s[_UD])
    delta = s[_X] - top - s[_W]
    rate = s[_V] - top_rate
    felt, loss, recede = 0.0, 0.0, 0.0
    if touching:
        felt, loss = _forces(delta, rate, p, codes, values, s, memory)
        if p[IMPEDANCE] > 0.0:
            # w' = F/Z with F affine in (rate - w'): one secant step is exact.
            first = felt + loss
            trial = first / p[IMPEDANCE]
            e2, l2 = _forces(delta, rate - trial, p, codes, values, s, memory)
            slope = (first - e2 - l2) / trial if trial != 0.0 else 0.0
            recede = first / (p[IMPEDANCE] + slope)
            felt, loss = _forces(delta, rate - recede, p, codes, values, s, memory)
    drive = _relaxing_towards(delta, touching, p, codes, values, s)
    for i in range(TERMS):
        ds[_Z + i] = 0.0
        if codes[i] == RELAXATION:
            ds[_Z + i] = (drive - s[_Z + i]) / values[i, 1]
    ds[_X] = s[_V]
    ds[_V] = p[GRAVITY] - (felt + loss) / (p[MASS] * (1.0 - p[INNER_SHARE]))
    ds[_I] = ds[_ID] = 0.0
    if p[INNER_SHARE] > 0.0:
        w, share = p[INNER_OMEGA], p[INNER_SHARE]
        drag = w * w * (s[_X] - s[_I]) + 2.0 * p[INNER_ZETA] * w * (s[_V] - s[_ID])
        ds[_I], ds[_ID] = s[_ID], p[GRAVITY] + drag
        ds[_V] -= share / (1.0 - share) * drag
    ds[_W] = recede
    for i in range(_U, _W):
        ds[i] = 0.0
    if p[RIGID] > 0.0:
        return felt
    push = felt + (1.0 if p[REACTION] > 0.0 else p[SHARE]) * loss
    if p[COUPON_MASS] > 0.0:
        thinner = s[_Y] - s[_U]
        firmer = 1.0 + p[LAYER_HARDENING] * max(thinner, 0.0)
        through = p[LAYER_K] * firmer * thinner + p[LAYER_C] * (s[_YD] - s[_UD])
        ds[_Y] = s[_YD]
        ds[_YD] = (push - through) / p[COUPON_MASS]
        push = through
    squeeze = s[_U] - s[_BS]
    stiffness = p[CELL_K] if squeeze >= 0.0 else p[CELL_K] * p[TENSION_RATIO]
    stiffness *= max(1.0 + p[HARDENING] * squeeze, LEAST_STIFFNESS)
    damping = p[CELL_MU] * (1.0 + p[DAMPING_GROWTH] * abs(squeeze))
    cell = stiffness * squeeze + damping * (s[_UD] - s[_BSD])
    side = p[RUBBING] * math.tanh(s[_UD] / RUBBING_SPEED_M_PER_S)
    if p[MODE_MASS] > 0.0:
        w = p[MODE_OMEGA]
        reach = s[_U] - s[_Q]
        reach *= 1.0 if reach >= 0.0 else p[MODE_STRETCHED]
        pull = w * w * reach + 2.0 * p[MODE_ZETA] * w * (s[_UD] - s[_QD])
        side += p[MODE_MASS] * pull
        ds[_Q], ds[_QD] = s[_QD], pull
    ds[_U] = s[_UD]
    ds[_UD] = (push - cell - side) / p[CELL_MASS]
    if p[BASE_MASS] > 0.0:
        ds[_BS] = s[_BSD]
        sliding = p[BASE_FRICTION] * math.tanh(s[_BSD] / SLIDING_SPEED_M_PER_S)
        ds[_BSD] = (cell - p[BASE_K] * s[_BS] - p[BASE_C] * s[_BSD] - sliding) / p[BASE_MASS]
    return felt


@_compiled
def _between(theta: float, start: Vector, F: Vector, out: Vector) -> None:
    for j in range(_N):
        acc = 0.0
        for i in range(7):
            acc += F[6 - i, j]
            acc *= theta if i % 2 == 0 else 1.0 - theta
        out[j] = acc + start[j]


@_compiled
def _gap(s: Vector, p: Vector) -> float:
    return float(s[_X] - (s[_Y] if p[COUPON_MASS] > 0.0 else s[_U]) - s[_W])


@_compiled
def _gap_rate(s: Vector, p: Vector) -> float:
    return float(s[_V] - (s[_YD] if p[COUPON_MASS] > 0.0 else s[_UD]))


@_compiled
def _total_force(
    s: Vector, p: Vector, codes: NDArray[np.int64], values: Vector, memory: Vector
) -> float:
    """Return elastic and dissipative force; a receding plate changes its size, not its sign. [N]"""
    felt, loss = _forces(_gap(s, p), _gap_rate(s, p), p, codes, values, s, memory)
    return felt + loss


@_compiled
def _relaxes(codes: NDArray[np.int64]) -> bool:
    found = False
    for code in codes:
        found = found or bool(code == RELAXATION)
    return found


@_compiled
def _event(  # noqa: PLR0917 - compiled code knows no keywords
    kind: int, s: Vector, p: Vector, codes: NDArray[np.int64], values: Vector, memory: Vector
) -> float:
    """Return a value that falls through zero at the event of this kind."""
    sticks = p[LAW] == JKR or p[LAW] == DMT
    by_force = p[LIFT_OFF_RULE] == AT_FORCE
    if kind == _LEAVES:
        above = _gap(s, p) - _release_indentation(p, memory)
        if above > 0.0 and (by_force or (_relaxes(codes) and not sticks)):
            # the paper's dashpot pulls the sphere to the end, a relaxed body cannot
            felt, loss = _forces(_gap(s, p), _gap_rate(s, p), p, codes, values, s, memory)
            # no surface bears more than DMT's pull-off, which of the two theories is the larger
            bears = 2.0 * math.pi * p[LAW_VALUE] * p[RADIUS] if sticks else 0.0
            above = felt + loss + bears if by_force else felt
        return float(above)
    by_force = by_force and not sticks
    if kind == _TOUCHES:
        # A surface that is still coming back is met below zero, where the force would turn to push.
        if by_force and _gap(s, p) > 0.0:
            return -_total_force(s, p, codes, values, memory)
        return -_gap(s, p)
    if kind == _TURNS:  # deepest point of a yielding contact
        return _gap_rate(s, p)
    return float(memory[1] - _gap(s, p))  # a reloaded dent reaches virgin material


@_compiled
def _stages(  # noqa: PLR0917 - compiled code knows no keywords
    s: Vector,
    h: float,
    touching: bool,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    memory: Vector,
    rates: Vector,
    stage: Vector,
    new: Vector,
) -> None:
    """Fill stages 1 to 12 of a trial step; ``rates[0]`` holds the slope at its start."""
    for i in range(1, 13):
        for j in range(_N):
            acc = 0.0
            for m in range(i):
                acc += (_A[i, m] if i < 12 else _B[m]) * rates[m, j]
            stage[j] = s[j] + h * acc
        _motion(stage, touching, p, codes, values, memory, rates[i])
    new[:] = stage


@_compiled
def _error(  # noqa: PLR0917 - compiled code knows no keywords
    s: Vector, new: Vector, h: float, rates: Vector, atol: Vector, tolerance: float
) -> float:
    """Return the step's error in units of what is allowed (Hairer's blend of 5th and 3rd order)."""
    e5 = e3 = 0.0
    for j in range(_N):
        scale = atol[j] + tolerance * max(abs(s[j]), abs(new[j]))
        a5 = a3 = 0.0
        for m in range(13):
            a5 += _E5[m] * rates[m, j]
            a3 += _E3[m] * rates[m, j]
        e5 += (a5 / scale) ** 2
        e3 += (a3 / scale) ** 2
    if e5 == 0.0 and e3 == 0.0:
        return 0.0
    return h * e5 / math.sqrt((e5 + 0.01 * e3) * _NORM)


@_compiled
def _dense(  # noqa: PLR0917 - compiled code knows no keywords
    s: Vector,
    new: Vector,
    h: float,
    touching: bool,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    memory: Vector,
    rates: Vector,
    stage: Vector,
    F: Vector,
) -> None:
    """Fill the coefficients of the 7th-order polynomial through an accepted step."""
    for e in range(3):
        for j in range(_N):
            acc = 0.0
            for m in range(13 + e):
                acc += _A_EXTRA[e, m] * rates[m, j]
            stage[j] = s[j] + h * acc
        _motion(stage, touching, p, codes, values, memory, rates[13 + e])
    for j in range(_N):
        F[0, j] = new[j] - s[j]
        F[1, j] = h * rates[0, j] - F[0, j]
        F[2, j] = 2.0 * F[0, j] - h * (rates[12, j] + rates[0, j])
        for i in range(4):
            acc = 0.0
            for m in range(16):
                acc += _D[i, m] * rates[m, j]
            F[3 + i, j] = h * acc


@_compiled
def _is_possible(kind: int, touching: bool, p: Vector, memory: Vector) -> bool:
    if kind in (_TOUCHES, _LEAVES):
        return touching == (kind == _LEAVES)
    if not touching or p[LAW] != YIELDING:
        return False
    return bool((memory[0] > 0.0) == (kind == _DEEPER_THAN_EVER))


@_compiled
def _first_event(  # noqa: PLR0917 - compiled code knows no keywords
    s: Vector,
    new: Vector,
    fresh: bool,
    touching: bool,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    memory: Vector,
    F: Vector,
    out: Vector,
) -> tuple[float, int]:
    """Return where in the step the earliest event lies and its kind; kind -1 for none."""
    theta, found = 2.0, -1
    for kind in range(4):
        if not _is_possible(kind, touching, p, memory):
            continue
        if _event(kind, new, p, codes, values, memory) >= 0.0:
            continue
        # An event that is at zero when the step begins is the one that began it.
        begins = _event(kind, s, p, codes, values, memory)
        if not (fresh and kind == _LEAVES) and begins <= 0.0:
            continue
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            _between(middle, s, F, out)
            if _event(kind, out, p, codes, values, memory) >= 0.0:
                low = middle
            else:
                high = middle
        if high < theta:
            theta, found = high, kind
    return theta, found


@_compiled
def _deepest(s: Vector, p: Vector, F: Vector, out: Vector) -> None:
    """Find where in the step the approach turns into retreat, for the peak between two steps."""
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        _between(middle, s, F, out)
        if _gap_rate(out, p) > 0.0:
            low = middle
        else:
            high = middle


@_compiled
def _tolerances(speed: float, p: Vector, tolerance: float) -> Vector:
    """Return absolute tolerances from the scales of a Hertz impact on a resting crystal."""
    deep = (1.25 * p[MASS] * speed * speed / p[K]) ** 0.4
    small = p[K] * deep**1.5 / p[CELL_K]
    omega = math.sqrt(p[CELL_K] / p[CELL_MASS])
    atol = np.full(_N, tolerance * small)
    atol[_X] = atol[_W] = atol[_I] = tolerance * deep
    atol[_V] = atol[_ID] = tolerance * speed
    for i in (_UD, _YD, _BSD, _QD):
        atol[i] = tolerance * small * omega
    for i in range(TERMS):
        atol[_Z + i] = tolerance * deep**1.5
    return atol


@_compiled
def _back_after_s(s: Vector, p: Vector) -> float:
    """Return when a sphere in free flight is back at a surface that rests. [s]"""
    if p[GRAVITY] <= 0.0:
        return math.inf
    height, upward = max(-_gap(s, p), 0.0), -_gap_rate(s, p)
    return float((upward + math.sqrt(upward * upward + 2.0 * p[GRAVITY] * height)) / p[GRAVITY])


@_compiled
def _next_step(h: float, error: float, event: int, forced: bool) -> float:
    if event == _LEAVES:
        return 1e-8
    if event >= 0 or forced:
        return min(1e-9, 0.1 * h)
    return h * (6.0 if error == 0.0 else min(6.0, 0.9 * error**-0.125))


@_compiled_and_kept
def integrate(  # noqa: PLR0917, PLR0912, PLR0915 - one loop, one state; splitting it hides the order
    speed: float,
    p: Vector,
    codes: NDArray[np.int64],
    values: Vector,
    tolerance: float,
    first_s: float,
    step_s: float,
    compression: Vector,
    force: Vector,
) -> Vector:
    """Integrate one impact from touch-down and sample it on a regular grid.

    Parameters
    ----------
    p : ndarray, shape (PARAMETERS,)
        Constants in the order of this module's names. [SI]
    codes : ndarray of int64, shape (TERMS,)
        Which additional contact terms act; 0 ends the list.
    values : ndarray, shape (TERMS, VALUES)
        Their parameters. [SI]
    tolerance : float
        Relative tolerance of the step control; absolute ones follow from the impact's scales. [1]
    first_s, step_s : float
        Time of the first grid point after touch-down and grid step. [s]
    compression, force : ndarray, shape (n,)
        Filled with the crystal's compression [m] and the force that a rigid cell reads [N]; zero
        where quiet.

    Returns
    -------
    ndarray, shape (SUMMARY,)
        Summary in the order of this module's names. [SI]
    """
    s, new, stage, out = np.zeros(_N), np.zeros(_N), np.zeros(_N), np.zeros(_N)
    memory, rates, F, summary = (
        np.zeros(4),
        np.zeros((16, _N)),
        np.zeros((7, _N)),
        np.zeros(SUMMARY),
    )
    atol = _tolerances(speed, p, tolerance)
    s[_V] = speed
    if p[INNER_SHARE] > 0.0:
        s[_ID] = speed
    touching, flown, recontacted = True, False, p[RECONTACT_AT] <= 0.0
    t, h, loud_s, steps = 0.0, 1e-9, 0.0, 0
    grid, points = 0, compression.size
    while grid < points and first_s + grid * step_s < 0.0:
        grid += 1
    _motion(s, touching, p, codes, values, memory, rates[0])
    while True:
        steps += 1
        if steps > _MAX_STEPS:
            summary[STATUS] = TOO_MANY_STEPS
            break
        h = min(h, _LONGEST_STEP_S)
        forced = (not recontacted) and flown and t + h >= p[RECONTACT_AT]
        if forced:
            h = max(p[RECONTACT_AT] - t, 1e-12)
        _stages(s, h, touching, p, codes, values, memory, rates, stage, new)
        error = _error(s, new, h, rates, atol, tolerance)
        if error > 1.0 and h > 1e-15:
            h *= max(0.2, 0.9 * error**-0.125)
            continue
        _dense(s, new, h, touching, p, codes, values, memory, rates, stage, F)
        theta, event = _first_event(s, new, t == 0.0, touching, p, codes, values, memory, F, out)
        used = h if event < 0 else theta * h
        if touching and _gap_rate(s, p) > 0.0 >= _gap_rate(new, p):
            _deepest(s, p, F, out)
            gap = _gap(out, p)
            peak = _forces(gap, 0.0, p, codes, values, out, memory)[0]
            summary[INDENTATION_PEAK] = max(summary[INDENTATION_PEAK], gap)
            summary[FORCE_PEAK] = max(summary[FORCE_PEAK], peak)
        while grid < points and first_s + grid * step_s <= t + used:
            _between((first_s + grid * step_s - t) / h, s, F, out)
            compression[grid] = out[_U] - out[_BS]
            if touching and p[RIGID] > 0.0:
                rate = _gap_rate(out, p)
                felt, loss = _forces(_gap(out, p), rate, p, codes, values, out, memory)
                force[grid] = felt + loss if p[REACTION] > 0.0 else felt
            grid += 1
        if event >= 0:
            _between(theta, s, F, new)
        t += used
        s[:] = new
        if event == _LEAVES:
            touching = False
            if not flown:
                inner = p[INNER_SHARE]
                summary[REBOUND], summary[LIFT_OFF] = -(1.0 - inner) * s[_V] - inner * s[_ID], t
                summary[LIFT_OFF_DEPTH], summary[LIFT_OFF_PLACE] = _gap(s, p), s[_X]
                summary[LIFT_OFF_FORCE] = _total_force(s, p, codes, values, memory)
                flown = True
            if p[LIFT_OFF_RULE] == AT_INDENTATION:
                memory[:] = 0.0
        elif event == _TOUCHES:
            touching = True
            if _gap(s, p) < LEAST_DEPTH_M:  # else it meets the dent it has just left
                memory[:] = 0.0
        elif event == _TURNS:
            _begin_unloading(_gap(s, p), p, memory)
        elif event == _DEEPER_THAN_EVER:
            memory[0] = 0.0
        elif forced:
            recontacted = True
            if not touching:
                touching = True
                s[_X] -= _gap(s, p)
                s[_V] += p[RECONTACT_SPEED] - _gap_rate(s, p)
        felt = _motion(s, touching, p, codes, values, memory, rates[0])
        h = _next_step(h, error, event, forced)
        squeezed = abs(s[_U] - s[_BS])
        if touching:
            summary[FORCE_PEAK] = max(summary[FORCE_PEAK], felt)
            summary[INDENTATION_PEAK] = max(summary[INDENTATION_PEAK], _gap(s, p))
        summary[COMPRESSION_PEAK] = max(summary[COMPRESSION_PEAK], squeezed)
        if touching or squeezed > 1e-6 * summary[COMPRESSION_PEAK]:
            loud_s = t
        if not flown and t > 0.05:
            summary[STATUS] = NEVER_LEFT  # too slow or too sticky to leave
            break
        if flown and grid >= points:
            break
        if flown and not touching and recontacted and t - loud_s > _QUIET_S:
            # a second contact hops on within the record, and goes on as long as it can be back
            ends_s = first_s + points * step_s if p[RECONTACT_AT] > 0.0 else 0.0
            if t + _back_after_s(s, p) > ends_s:
                break
    summary[END], summary[STEPS] = t, steps
    return summary
