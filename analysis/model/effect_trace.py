"""The effects' hooks give the numbers of the compiled solver, for a trace and its neighbours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Array
from analysis.effects.effect import Effect, ShotContext
from analysis.effects.library import term_addresses
from analysis.model.by_address import address_of
from analysis.model.effect_solver import integrate_columns
from analysis.model.structure import RIGID, Assembled, Structure

EffectValues = Mapping[str, Mapping[str, float]]
"""Physical values by effect id and parameter name."""
_PACKED = 4
"""Numbers of a contact term, see `analysis.model.effect_solver.TERM`."""


@dataclass(frozen=True)
class Column:
    """One set of numbers that a trace is wanted for."""

    row: int
    """Where in the table its samples go."""
    local: Array
    values: EffectValues
    """The effects' physical values, by effect id and parameter name."""
    context: ShotContext
    """What the effects may know of the shot."""
    step: float = 0.0
    """How far its moved parameter is from the first column's."""
    same_structure: bool = False
    """The structure is that of the first column."""


@dataclass(frozen=True)
class Cell:
    """The load cell of one column."""

    mass_kg: float
    stiffness_n_per_m: float
    damping_n_s_per_m: float
    """M, k, mu; NaN for a rigid cell."""
    gain: float
    """Output per metre of compression, or per newton for a rigid cell."""
    coupon_kg: float = 0.0
    """What rides on the crystal. [kg]"""


def _structure(effects: Sequence[Effect], cell: Cell, column: Column) -> Structure:
    """Return what the sphere lands on, with every effect's masses added in their order."""
    found = Structure.kelvin_voigt(
        cell.mass_kg, cell.stiffness_n_per_m, cell.damping_n_s_per_m, cell.coupon_kg
    )
    for effect in effects:
        if effect.structure is not None:
            effect.structure(found, column.values[effect.id], column.context)
    return found


def _numbers(effects: Sequence[Effect], cell: Cell, column: Column) -> tuple[float, ...]:
    """Return a column's row of numbers, as `effect_solver.NUMBERS` orders them."""
    context = column.context
    share, mobility, reach, dashpot = 0.0, 0.0, 0.0, 1.0
    bears, counted = math.inf, 0.0
    if context.reacts:
        share = 1.0
    if context.ends_with_force:
        bears, counted = 0.0, 1.0
    elif any(effect.parts_by_force for effect in effects):
        bears = 0.0
    for effect in effects:
        if effect.share is not None:
            share = effect.share(column.values[effect.id])
        if effect.base_dashpot is not None:
            dashpot *= effect.base_dashpot(column.values[effect.id])
        if effect.mobility is not None:
            mobility += effect.mobility(column.values[effect.id])
        if effect.bears is not None:
            bears += effect.bears(column.values[effect.id], context)
        if effect.reach is not None:
            reach = max(reach, effect.reach(column.values[effect.id], context))
    return (
        -context.touch_down_s,
        1.0 / context.sample_rate_hz,
        context.stiffness,
        context.mass_kg,
        context.speed_m_per_s,
        dashpot * context.alpha,
        context.gravity_m_per_s2,
        share,
        mobility,
        cell.gain,
        reach,
        bears,
        counted,
    )


def _distinct(
    effects: Sequence[Effect], cells: Sequence[Cell], columns: Sequence[Column]
) -> tuple[list[Structure], list[int]]:
    """Return the structures that differ, and which of them each column stands on."""
    found: list[Structure] = []
    which: list[int] = []
    for cell, column in zip(cells, columns, strict=True):
        if found and column.same_structure:
            which.append(0)
            continue
        structure = _structure(effects, cell, column)
        if structure not in found:
            found.append(structure)
        which.append(found.index(structure))
    return found, which


def _stacked(found: Sequence[Assembled]) -> tuple[Array, Array, Array, NDArray[np.int64]]:
    """Return structures as arrays; one that lacks a mass of another's gets it idle.

    At its neutral value an effect may leave its mass out, where a neighbour has it.
    """
    most = max(m.load.size for m in found)
    systems = np.zeros((len(found), most, 2 * most))
    loads, readings = np.zeros((len(found), most)), np.zeros((len(found), most))
    for s, m in enumerate(found):
        own = m.load.size
        systems[s, :own, : 2 * own] = m.accelerations
        loads[s, :own], readings[s, :own] = m.load, m.reading
    return systems, loads, readings, np.array([m.top for m in found])


_RIGID = _stacked([RIGID])


def integrate_with_effects(
    table: Array,
    effects: Sequence[Effect],
    columns: Sequence[Column],
    cells: Sequence[Cell],
    *,
    steps: int,
    before: tuple[Array, float] | None = None,
) -> tuple[Array, Array]:
    """Integrate columns into the rows of a table of traces that they name. [unit of the signal]

    The first column is the trace that others may refer to; ``cells`` has one for each.

    Parameters
    ----------
    before : tuple of ndarray, shape (c, 2 q), and float, optional
        How the structure moved some time before touch-down, its ring already among the samples,
        and that time; at rest by default. [m and m/s, s]

    Returns
    -------
    found : ndarray, shape (c, 3)
        Contact time [s], rebound speed [m/s], largest indentation [m]; NaN where the contact did
        not end.
    states : ndarray, shape (c, 2 q)
        Displacements and velocities of the structure's q masses at lift-off. [m, m/s]
    """
    addresses = term_addresses()
    acting = [e for e in effects if e.contact is not None]
    calls = [e for e in acting for _ in range(e.memories)]
    packed = np.empty((len(columns), len(calls), _PACKED))
    for row, column in zip(packed.reshape(len(columns), -1), columns, strict=True):
        at = 0
        for effect in acting:
            assert effect.pack is not None
            end = at + _PACKED * effect.memories
            row[at:end] = effect.pack(column.values[effect.id], column.context)
            at = end
    if math.isnan(cells[0].mass_kg):
        matrices, which = _RIGID, [0] * len(columns)
    else:
        structures, which = _distinct(effects, cells, columns)
        matrices = _stacked([s.assemble() for s in structures])
    found = np.empty((len(columns), 3))
    states = np.zeros((len(columns), 2 * matrices[1].shape[1]))
    span = 0.0
    if before is not None:
        moving, span = before
        states[:] = moving[:, : states.shape[1]]  # a mass that only a neighbour had is at rest
    integrate_columns(
        table,
        np.array([c.row for c in columns]),
        np.array([_numbers(effects, *pair) for pair in zip(cells, columns, strict=True)]),
        np.array([addresses.get(e.id) or address_of(e.contact) for e in calls], dtype=np.int64),
        packed,
        np.array(which),
        *matrices,
        steps,
        found,
        states,
        np.full(len(columns), span),
    )
    return found, states
