"""Figures 2 and 4 of the paper, as numbers; its single claims beside them are in `numbers`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.aliases import Array
from analysis.paper.contact import (
    FIG2_CELL,
    FIG2_DROP,
    Cell,
    Drop,
    contact_history,
    crystal_trace,
)

FIG2_RESTITUTIONS = (0.7, 0.8, 0.9, 1.0)
FIG4_MASSES_KG = tuple(float(x) for x in np.geomspace(0.010, 0.200, 13))
FIG4_STIFFNESSES_N_PER_M = tuple(float(x) for x in np.geomspace(0.2e9, 2.0e9, 13))
FIG4_DAMPING_RATIO = 0.15
FIG4_RESTITUTION = 0.8
"""The source as we have it names none for Fig. 4; the middle of Fig. 2's."""


@dataclass(frozen=True)
class ImpactFigures:
    """The numbers one reads off Fig. 2 at one restitution, eps of Eq. 6."""

    restitution: float
    peak_force_n: float
    """Of the elastic force."""
    peak_force_at_s: float
    contact_time_s: float
    deepest_indentation_m: float
    deepest_crystal_m: float
    crystal_delay_s: float
    """From the peak of the force to the peak of the crystal."""
    rebound_ratio: float
    """Sphere's rebound over impact speed at lift-off. [1]"""
    rigid_rebound_ratio: float
    """The same without the crystal. [1]"""

    @property
    def indentation_over_crystal(self) -> float:
        """Return delta_max / Delta_max. [1]"""
        return self.deepest_indentation_m / self.deepest_crystal_m


def figure_2(restitution: float, drop: Drop = FIG2_DROP, cell: Cell = FIG2_CELL) -> ImpactFigures:
    """Return what Fig. 2 shows at one restitution (eps of Eq. 6), with the crystal.

    Drop and cell are Fig. 2's by default. Peaks are to 1 ns in time.
    """
    coupled, rigid = (contact_history(drop, restitution, c) for c in (cell, None))
    period_s = 1 / cell.natural_frequency_hz
    times = np.arange(0.0, coupled.contact_time_s + period_s, 1e-9)
    force = drop.stiffness * coupled.indentation_at(times) ** 1.5
    crystal = crystal_trace(drop, restitution, cell, times)
    at, late = times[int(np.argmax(force))], times[int(np.argmax(crystal))]
    return ImpactFigures(
        restitution=restitution,
        peak_force_n=float(force.max()),
        peak_force_at_s=float(at),
        contact_time_s=coupled.contact_time_s,
        deepest_indentation_m=float(coupled.indentation_m.max()),
        deepest_crystal_m=float(crystal.max()),
        crystal_delay_s=float(late - at),
        rebound_ratio=coupled.rebound_speed_m_per_s / drop.speed_m_per_s,
        rigid_rebound_ratio=rigid.rebound_speed_m_per_s / drop.speed_m_per_s,
    )


def force_difference(
    cell: Cell, drop: Drop = FIG2_DROP, restitution: float = FIG4_RESTITUTION
) -> tuple[float, float, float]:
    """Return by how much the crystal changes the forces of a contact.

    The largest difference of F_el between KV and HSD at the same time [N], the same over HSD's peak
    [1], and the largest difference of F_el + F_dis, which jumps at lift-off [N].
    """
    coupled, rigid = (contact_history(drop, restitution, c) for c in (cell, None))
    end = max(coupled.contact_time_s, rigid.contact_time_s)
    times = np.linspace(0.0, end, 4001)
    elastic = [drop.stiffness * h.indentation_at(times) ** 1.5 for h in (coupled, rigid)]
    total = [
        f + np.interp(times, h.time_s, h.dissipative_n, right=0.0)
        for f, h in zip(elastic, (coupled, rigid), strict=True)
    ]
    difference = float(np.abs(elastic[0] - elastic[1]).max())
    return (
        difference,
        difference / float(elastic[1].max()),
        float(np.abs(total[0] - total[1]).max()),
    )


def figure_4(
    masses_kg: Sequence[float] = FIG4_MASSES_KG,
    stiffnesses_n_per_m: Sequence[float] = FIG4_STIFFNESSES_N_PER_M,
) -> tuple[Array, Array, Array]:
    """Return Fig. 4: how far HSD and KV are apart in force, whatever the crystal.

    The grid has M in rows and k in columns, a damping ratio of 0.15 throughout. The three arrays
    are as `force_difference` returns them.
    """
    found = np.array(
        [
            [
                force_difference(Cell(m, k, 2 * FIG4_DAMPING_RATIO * math.sqrt(k * m)))
                for k in stiffnesses_n_per_m
            ]
            for m in masses_kg
        ]
    )
    return found[..., 0], found[..., 1], found[..., 2]
