"""Figs 5 and 6: one drop of every pair, recorded by simulated cells and read by each model.

The record is the simulator's, for the moduli of Tables 1-2 and the cell of Table 3, without noise:
whatever a model cannot follow is the model's. The paper's own traces are not used.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from analysis.aliases import Array
from analysis.model.hertz import closed_damping_coefficient
from analysis.paper.contact import (
    GRAVITY_M_PER_S2,
    TABLE3_CELL,
    TABLE3_COMPLIANCE_M_PER_V,
    TABLE3_HSD_N_PER_V,
    Cell,
    Drop,
    drop_of,
)
from analysis.paper.fits import fit_pulse
from analysis.paper.traces import hsd_volts, kv_volts
from drivers.simulated import impact_kernel
from drivers.simulated.impact import Mechanics, simulate_impact
from drivers.simulated.specimens import SURFACES
from impactd.paper.rig_claims import HEIGHT_M
from impactd.paper.source import literature_reduced, reduced, rows, tables

Pair = tuple[str, str]
Model = Callable[[Drop, Array], Array]

RESTITUTION = 0.8
"""Like the height Fig. 2's: our copy of the source says neither for Figs 5 and 6."""
TIMES_S: Array = np.arange(400, dtype=np.float64) * 1e-6
"""The paper's 1 MHz, as long as the ring is seen."""

FIGURE_PAIRS: dict[str, tuple[Pair, ...]] = {
    name: tuple((sphere, surface) for surface in ("aluminium", "pvc", "polycarbonate", "ptfe"))
    for name, sphere in (("figure-5", "acetal"), ("figure-6", "polypropylene"))
}
"""Eight traces. Our copy does not say whose; these two spheres are in Tables 4 and 5 on all four
coupons, which go from stiff to soft."""


@dataclass(frozen=True)
class Reading:
    """A record as one model reads it, with E* and perhaps the touch-down free.

    Attributes
    ----------
    modulus_ratio : float
        E* over the true one. [1]
    r2 : float
        1 - SS_res / SS_tot. [1]
    signal : ndarray, shape (n,)
        The model's trace. [V]
    """

    modulus_ratio: float
    r2: float
    signal: Array

    @property
    def residual(self) -> float:
        """Return what is left, rms over the standard deviation of the record. [1]"""
        return math.sqrt(max(1.0 - self.r2, 0.0))


@dataclass(frozen=True)
class PairTraces:
    """One pair.

    Attributes
    ----------
    reduced_modulus_pa : float
        E* of Tables 1-2. [Pa]
    coupon_kg : float
        Mass of our coupon of this material; the paper's is not in our copy. [kg]
    paper_rig_v, closed_rig_v : ndarray, shape (n,)
        Records at `TIMES_S`, by Eqs 1-11 as printed, and with the third law, the coupon on the
        crystal and an end of contact where the force ends. [V]
    hsd, kv : Reading
        Of the paper's rig.
    loaded, bare : Reading
        By ``kv`` of the closed rig: with M that holds the coupon, as a calibration with coupons
        finds it, and with the crystal's alone.
    loaded_onset, bare_onset : Reading
        The same with the touch-down held.
    kv2 : Reading
        By ``kv2`` of the closed rig.
    """

    pair: Pair
    reduced_modulus_pa: float
    coupon_kg: float
    paper_rig_v: Array
    closed_rig_v: Array
    hsd: Reading
    kv: Reading
    loaded: Reading
    bare: Reading
    loaded_onset: Reading
    bare_onset: Reading
    kv2: Reading

    @property
    def closed_readings(self) -> tuple[float, float]:
        """Return the lowest and highest E* over the true one that ``kv`` reads of a closed rig."""
        found = [
            r.modulus_ratio for r in (self.loaded, self.bare, self.loaded_onset, self.bare_onset)
        ]
        return min(found), max(found)


def drop_for(pair: Pair, reduced_modulus_pa: float) -> Drop:
    """Return the drop of a pair from `HEIGHT_M`."""
    sphere = tables()["sphere"][pair[0]]
    return drop_of(sphere["radius_m"], sphere["mass_kg"], reduced_modulus_pa, HEIGHT_M)


def hsd_model(drop: Drop, times_s: Array) -> Array:
    """Return HSD's trace with Table 3's S. [V]"""
    return hsd_volts(drop, RESTITUTION, TABLE3_HSD_N_PER_V, times_s)


def kv_model(cell: Cell = TABLE3_CELL, coupon_kg: float | None = None) -> Model:
    """Return a model of a drop's trace with Table 3's c; ``kv2`` where a coupon is given."""

    def volts(drop: Drop, times_s: Array) -> Array:
        """Return the trace. [V]"""
        return kv_volts(
            drop, RESTITUTION, cell, TABLE3_COMPLIANCE_M_PER_V, times_s, coupon_kg=coupon_kg
        )

    return volts


def printed_trace(pair: Pair, table: str) -> Array:
    """Return the trace of Table 3's cell with the moduli that Table 4 or 5 prints for a pair. [V]

    Parameters
    ----------
    pair : tuple of str
        (sphere, surface), a row of the table.
    table : str
        ``table4_hsd`` (by HSD) or ``table5_kv`` (by KV).

    Returns
    -------
    ndarray, shape (n,)
        At `TIMES_S`.
    """
    row = rows(table)[pair]
    drop = drop_for(pair, reduced(pair, row.sphere_pa, row.surface_pa))
    return (hsd_model if table == "table4_hsd" else kv_model())(drop, TIMES_S)


def record(pair: Pair, *, coupon_kg: float | None = None) -> Array:
    """Return the simulator's record of a pair's drop at `TIMES_S`, without noise.

    Parameters
    ----------
    pair : tuple of str
        (sphere, surface), with the moduli of Tables 1-2.
    coupon_kg : float, optional
        None for the paper's rig; a mass for a closed one. [kg]

    Returns
    -------
    ndarray, shape (n,)
        [V]
    """
    sphere = tables()["sphere"][pair[0]]
    closed = coupon_kg is not None
    mechanics = Mechanics(
        sphere_mass_kg=sphere["mass_kg"],
        sphere_radius_m=sphere["radius_m"],
        reduced_modulus_pa=literature_reduced(pair),
        restitution=RESTITUTION,
        gravity_m_per_s2=GRAVITY_M_PER_S2,
        cell_mass_kg=TABLE3_CELL.mass_kg,
        cell_stiffness_n_per_m=TABLE3_CELL.stiffness_n_per_m,
        cell_damping_n_s_per_m=TABLE3_CELL.damping_n_s_per_m,
        third_law=closed,
        coupon_rides=closed,
        coupon_label_mass_kg=coupon_kg or 0.0,
        lift_off_rule=impact_kernel.AT_FORCE if closed else impact_kernel.AT_INDENTATION,
        # the sphere rebounds with the same eps, wherever its contact ends
        loss_constant=closed_damping_coefficient(RESTITUTION) if closed else None,
    )
    speed = drop_for(pair, 1e9).speed_m_per_s
    step_s = float(TIMES_S[1] - TIMES_S[0])
    trace = simulate_impact(mechanics, speed, step_s=step_s, points=TIMES_S.size)
    return trace.compression_m / TABLE3_COMPLIANCE_M_PER_V


@cache
def all_pair_traces() -> dict[Pair, PairTraces]:
    """Return every pair of Table 5, recorded and read."""
    return {pair: _one(pair) for pair in rows("table5_kv")}


def _one(pair: Pair) -> PairTraces:
    coupon = SURFACES[pair[1]].coupon_mass_kg
    ours, closed = record(pair), record(pair, coupon_kg=coupon)
    laden = kv_model(replace(TABLE3_CELL, mass_kg=TABLE3_CELL.mass_kg + coupon))
    return PairTraces(
        pair=pair,
        reduced_modulus_pa=literature_reduced(pair),
        coupon_kg=coupon,
        paper_rig_v=ours,
        closed_rig_v=closed,
        hsd=_read(pair, ours, hsd_model),
        kv=_read(pair, ours, kv_model()),
        loaded=_read(pair, closed, laden),
        bare=_read(pair, closed, kv_model()),
        loaded_onset=_read(pair, closed, laden, free_timing=False),
        bare_onset=_read(pair, closed, kv_model(), free_timing=False),
        kv2=_read(pair, closed, kv_model(coupon_kg=coupon)),
    )


def _read(pair: Pair, signal: Array, model: Model, *, free_timing: bool = True) -> Reading:
    def predicted(modulus_pa: float, shift_us: float) -> Array:
        """Return the model's trace for an E* and a later touch-down. [V]"""
        return model(drop_for(pair, modulus_pa), TIMES_S - 1e-6 * shift_us)

    true = literature_reduced(pair)
    found = fit_pulse(signal, predicted, true, free_timing=free_timing)
    trace = predicted(found.reduced_modulus_pa, found.shift_us)
    return Reading(found.reduced_modulus_pa / true, found.r2, trace)
