"""A trace and its neighbours: which traces the derivative by each local parameter needs.

A trace is made in stages: the integration (base solver, or the one with effects), a second contact,
then the chain that reads the signal. A parameter moves the stages from its own on; what lies before
is taken from the trace itself.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from analysis.aliases import Array
from analysis.effects.effect import Effect, EffectParameter
from analysis.model import solver
from analysis.model.effect_trace import Cell, Column, integrate_with_effects

if TYPE_CHECKING:
    from analysis.model.impact_model import ImpactModel, ShotFrame


SOLVE, GAIN, AGAIN, READ, NOTHING = range(5)
"""Stages from which a parameter acts; a gain scales what was integrated."""

LOG_STEP = 1e-6
TIME_STEP_US = 1e-4
MOST_BOUNCES = 12
LEAST_STEPS = 48
PRESSED = 3.0
"""Times that speed, below which a contact is followed without what effects make of it."""
SLOWEST = 2e-4
"""Share of the impact speed below which no later contact is followed."""
SETTLES = 0.1
"""Times the speed at which inertia and weight press alike, below which a hop is not seen."""
_IN_CONTEXT = ("ln_K", "ln_v0", "ln_e", "t0_us")
_IN_STRUCTURE = ("ln_w", "ln_z", "ln_M")


@dataclass(frozen=True)
class Move:
    """How one local parameter is moved for its derivative."""

    at: int
    stage: int
    """From which stage on it acts."""
    step: float
    effect: Effect | None = None
    parameter: EffectParameter | None = None
    """Whose it is; None for the base model's, as is ``effect``."""
    in_context: bool = False
    """The effects' hooks may look at it."""
    same_structure: bool = False
    """It cannot change what the sphere lands on."""


@dataclass(frozen=True)
class End:
    """How a contact left what it touched."""

    time_s: float
    """Lift-off after the first touch-down; NaN where there was none. [s]"""
    state: Array
    """Displacements and velocities of the structure's masses; empty where nobody asks. Shape (2
    q,). [m, m/s]"""


def _stage_of(effect: Effect) -> int:
    if effect.in_solver:
        return SOLVE
    if effect.again is not None:
        return AGAIN
    return READ if effect.output is not None else NOTHING


def moves(model: ImpactModel) -> tuple[Move, ...]:
    """Return how each local parameter is moved; baseline and free sizes are analytic."""
    found = []
    hooked = any(e.structure is not None for e in model.effects)
    for at, name in enumerate(model.names):
        if name == "ln_S":
            found.append(Move(at, GAIN, LOG_STEP))
        elif name in _IN_CONTEXT:
            step = TIME_STEP_US if name == "t0_us" else LOG_STEP
            found.append(Move(at, SOLVE, step, in_context=True, same_structure=not hooked))
        elif at == model.coupon_share_at:
            found.append(Move(at, SOLVE, LOG_STEP, in_context=True, same_structure=not hooked))
        elif name in _IN_STRUCTURE:
            found.append(Move(at, SOLVE, LOG_STEP))
    for effect in model.effects:
        stage = _stage_of(effect)
        if stage == NOTHING:
            continue
        for parameter, at in zip(effect.parameters, model.places[effect.id], strict=True):
            same = effect.structure is None
            found.append(Move(at, stage, LOG_STEP, effect, parameter, same_structure=same))
    return tuple(found)


def moved(model: ImpactModel, frame: ShotFrame, centre: Column, move: Move) -> Column:
    """Return the column of one moved parameter, its samples in the row behind its place."""
    local = centre.local.copy()
    local[move.at] += move.step
    values, context = centre.values, centre.context
    if move.effect is not None and move.parameter is not None:
        own = dict(values[move.effect.id])
        own[move.parameter.name] = move.parameter.value(float(local[move.at]))
        values = {**values, move.effect.id: own}
    elif move.in_context:
        context = model.context(local, frame)
    return Column(move.at + 1, local, values, context, move.step, move.same_structure)


def _cell(model: ImpactModel, column: Column) -> Cell:
    """Return the cell from the identifiable forms."""
    local = column.local
    if model.kind != solver.KV:
        return Cell(math.nan, math.nan, math.nan, math.exp(-local[1]))
    omega0, zeta, mass = math.exp(local[2]), math.exp(local[3]), math.exp(local[4])
    k = mass * omega0**2
    coupon = column.context.coupon_on_crystal_kg
    return Cell(mass, k, 2 * zeta * mass * omega0, k * math.exp(-local[1]), coupon)


def _base_trace(
    signal: Array, model: ImpactModel, column: Column, steps: int, later: tuple[float, float]
) -> tuple[float, float, float]:
    """Add the base model's impact, delayed by ``later[0]`` [s], at ``later[1]`` of its speed."""
    cell, context = _cell(model, column), column.context
    found: tuple[float, float, float] = solver.integrate(
        signal,
        model.kind,
        -context.touch_down_s - later[0],
        1.0 / context.sample_rate_hz,
        context.stiffness,
        context.mass_kg,
        context.speed_m_per_s * later[1],
        context.alpha,
        context.gravity_m_per_s2,
        cell.mass_kg + cell.coupon_kg,
        cell.stiffness_n_per_m,
        cell.damping_n_s_per_m,
        cell.gain,
        steps,
        model.closed,
    )
    return found


def add_first_contacts(
    table: Array, model: ImpactModel, columns: list[Column], steps: int
) -> tuple[Array, list[End]]:
    """Integrate columns into the rows of a table of traces that they name. [unit of the signal]

    Return contact time [s], rebound speed [m/s] and largest indentation [m] of each column, shape
    (c, 3), and how each column's structure was left.
    """
    if model.left_out or any(e.in_solver or e.rides for e in model.effects):
        cells = [_cell(model, c) for c in columns]
        found, states = integrate_with_effects(table, model.effects, columns, cells, steps=steps)
        ends = [End(float(t), s) for t, s in zip(found[:, 0], states, strict=True)]
        return found, ends
    found = np.array([_base_trace(table[c.row], model, c, steps, (0.0, 1.0)) for c in columns])
    return found, [End(float(t), np.zeros(0)) for t in found[:, 0]]


def add_second_contacts(
    signal: Array, model: ImpactModel, column: Column, steps: int, end: End
) -> None:
    """Add to a trace the contacts that come after the first, of the same bodies.

    What touches again slowly bounces on within the window until it stays, a hop that is not seen
    being taken for the least that is.
    """
    for effect in model.effects:
        if effect.again is None:
            continue
        delay, ratio = effect.again(column.values[effect.id])
        last = signal.size / column.context.sample_rate_hz - column.context.touch_down_s
        speed = column.context.speed_m_per_s * ratio
        left = end if effect.rides else None
        for _ in range(MOST_BOUNCES):
            if not delay < last:
                break
            duration, rebound, state = _later_contact(
                signal, model, column, steps, later=(delay, speed), left=left
            )
            if not (math.isfinite(duration) and column.context.gravity_m_per_s2 > 0.0):
                break  # it stays, or never comes back
            left = End(delay + duration, state) if effect.rides else None
            # a hop that is not seen is taken for the least that is
            speed = max(rebound, SETTLES * _weighing_speed(column))
            delay += duration + _flight_s(model, column, speed)


def _flight_s(model: ImpactModel, column: Column, speed: float) -> float:
    r"""Return how long a sphere is away that leaves at some speed [m/s], until it touches again.

    Where its force ends the contact, the surface is still indented, and recovers behind the sphere:

    .. math:: \delta = (\alpha u \sqrt{m/K})^{4/5}, \quad T = (u + \sqrt{u^2 - 2 g \delta})/g

    The depth is that of the base's dashpot. What does not rise above the surface stays in touch,
    and is back as if it had left from there. [s]
    """
    context = column.context
    g = context.gravity_m_per_s2
    if not context.ends_with_force:
        return 2.0 * speed / g
    inertia = math.sqrt(context.mass_kg / context.stiffness)
    depth = (max(context.alpha, 0.0) * speed * inertia) ** 0.8
    rises = speed**2 - 2.0 * g * depth
    return (speed + (math.sqrt(rises) if rises > 0.0 else speed)) / g


def _weighing_speed(column: Column) -> float:
    """Return the speed at which inertia and weight press the sphere down alike. [m/s]"""
    context = column.context
    g = context.gravity_m_per_s2
    return math.sqrt(g * (context.mass_kg * g / context.stiffness) ** (2 / 3))


def _later_contact(
    signal: Array,
    model: ImpactModel,
    column: Column,
    steps: int,
    *,
    later: tuple[float, float],
    left: End | None,
) -> tuple[float, float, Array]:
    """Add a contact at a time after the first [s] and a speed [m/s].

    Return its duration, its rebound and the state after it.
    """
    if later[1] < SLOWEST * column.context.speed_m_per_s:
        return math.nan, math.nan, np.zeros(0)  # hardly moves, and the scheme does not follow it
    # a slow contact lasts longer, by speed^(-1/5), and the cell swings as fast as ever: in powers
    # of two, so that neighbours take the same steps; it is fainter, by speed^(6/5), and an error
    # that falls with the fifth power of the steps may be larger in itself
    slower = max(1.0, column.context.speed_m_per_s / later[1])
    steps <<= math.ceil(math.log2(slower) / 5.0)
    steps = min(max(steps >> int(0.24 * math.log2(slower)), LEAST_STEPS), solver.MAX_STEPS)
    pressed = later[1] < PRESSED * _weighing_speed(column)
    plain = not (model.left_out or any(e.in_solver for e in model.effects))
    if left is None and (pressed or plain):
        # where weight prevails, terms and masses change little of what is little itself
        ratio = later[1] / column.context.speed_m_per_s
        duration, rebound, _ = _base_trace(signal, model, column, steps, (later[0], ratio))
        return duration, rebound, np.zeros(0)
    context = dataclasses.replace(
        column.context,
        touch_down_s=column.context.touch_down_s + later[0],
        speed_m_per_s=later[1],
    )
    again = dataclasses.replace(column, row=0, context=context)
    cells = [_cell(model, column)]
    before = None
    if left is not None:
        span = later[0] - left.time_s
        if not span >= 0.0:
            return math.nan, math.nan, left.state  # it has not left yet
        before = left.state[None, :], span
    found, states = integrate_with_effects(
        signal[None, :], model.effects, [again], cells, steps=steps, before=before
    )
    return float(found[0, 0]), float(found[0, 1]), states[0]


def read(signal: Array, chain: tuple[Effect, ...], column: Column, since: int = 0) -> list[Array]:
    """Return a signal after each stage of the chain that reads it, itself first.

    ``signal`` enters the chain of effects at ``since``.
    """
    found = [signal]
    for effect in chain[since:]:
        assert effect.output is not None
        found.append(effect.output(found[-1], column.values[effect.id], column.context))
    return found


def free_part(model: ImpactModel, samples: int, column: Column) -> Array | None:
    """Return the signals of free size with this shot's coefficients, None where there are none."""
    found, at = None, model.first_size
    for effect in model.effects:
        if effect.basis is not None:
            size = effect.basis_size
            part = effect.basis(samples, column.context) @ column.local[at : at + size]
            found = part if found is None else found + part
            at += size
    return found


def fill_neighbours(
    table: Array,
    model: ImpactModel,
    frame: ShotFrame,
    centre: Column,
    *,
    steps: int,
    first: int,
) -> tuple[Array, Array]:
    """Fill a table with the trace (row 0) and the differences that the local parameters make.

    The table, shape (p + 1, n), is of zeros. It gets the trace without baseline and free sizes,
    then derivatives by the parameters from place ``first`` on. [unit of the signal, per unit of the
    parameter] Return the trace's row of `add_first_contacts` and the derivative of the rebound
    ratio, shape (p,).
    """
    chain = model.chain
    columns = [(m, moved(model, frame, centre, m)) for m in model.moves if m.at >= first]
    solved = [centre, *(c for move, c in columns if move.stage == SOLVE)]
    found, ends = add_first_contacts(table, model, solved, steps)
    gradient = np.zeros(centre.local.size)
    ratio = found[:, 1] / np.array([c.context.speed_m_per_s for c in solved])
    for c, r in zip(solved[1:], ratio[1:], strict=True):
        if c.step == LOG_STEP:  # touch-down does not change the rebound
            gradient[c.row - 1] = (r - ratio[0]) / LOG_STEP
    alone = table[0]
    if model.has_second_contacts:
        alone = table[0].copy()
        for c, end in zip(solved, ends, strict=True):
            add_second_contacts(table[c.row], model, c, steps, end)
    stages = read(table[0].copy(), chain, centre)
    for move, column in columns:
        row, since = table[column.row], 0
        if move.stage == GAIN:
            if not chain:
                row[:] = -stages[0]
                continue
            row[:] = stages[0] * math.exp(-move.step)
        elif move.stage == AGAIN:
            row[:] = alone
            add_second_contacts(row, model, column, steps, ends[0])
        if move.stage == READ:
            since = chain.index(move.effect)
            ahead = read(stages[since], chain, column, since)[-1]
        else:
            ahead = read(row, chain, column)[-1]
        np.subtract(ahead, stages[-1], out=row)
        row *= 1.0 / move.step
    table[0] = stages[-1]
    _differentiate_bases(table, model, columns, centre)
    return found[0], gradient


def _differentiate_bases(
    table: Array, model: ImpactModel, columns: list[tuple[Move, Column]], centre: Column
) -> None:
    """Add what the signals of free size change with the context that they are made from."""
    samples = table.shape[1]
    whole = free_part(model, samples, centre)
    if whole is None:
        return
    for move, column in columns:
        if move.in_context:
            part = free_part(model, samples, dataclasses.replace(column, local=centre.local))
            if part is not None:
                table[column.row] += (part - whole) / move.step
