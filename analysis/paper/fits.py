"""Fits as the paper makes them: one shot, one pair, and only the moduli free.

Cell, speed and restitution are taken as known. The touch-down is either where the signal starts or
free to shift, as a person does who lays a computed pulse over a measured one. Our own fits
(``analysis.fit``) do none of this; these exist to stand beside the paper's Tables 3-5.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from analysis.aliases import Array
from analysis.fit.problem import FitShot
from analysis.model.hertz import contact_stiffness
from analysis.model.impact_model import model_named
from analysis.paper.contact import Cell

_LN_E_GRID = np.linspace(-1.8, 1.8, 16)
_SHIFTS_US = np.arange(-5.0, 26.0, 5.0)


@dataclass(frozen=True)
class Known:
    """What the paper's fits hold fixed."""

    gain_n_per_v: float
    """S of Eq. 7, or k c. [N/V]"""
    cell: Cell | None
    """None for HSD."""
    speed_m_per_s: float
    restitution: float
    touch_down_us: float
    """After the window's first sample."""


@dataclass(frozen=True)
class ModulusOnly:
    """A fit with nothing but a modulus free (and perhaps the timing)."""

    reduced_modulus_pa: float
    """E*. [Pa]"""
    r2: float
    """1 - SS_res / SS_tot over the window. [1]"""
    shift_us: float
    """By how much the touch-down was moved. [us]"""


def predict(item: FitShot, known: Known, reduced_modulus_pa: float, shift_us: float = 0.0) -> Array:
    """Return the trace [V] over a shot's window, baseline included.

    ``shift_us`` is by how much the touch-down is later.
    """
    assert item.radius_m is not None
    ln_gain = math.log(known.gain_n_per_v)
    shared = [math.log(contact_stiffness(reduced_modulus_pa, item.radius_m)), ln_gain]
    if known.cell is not None:
        omega0 = 2 * math.pi * known.cell.natural_frequency_hz
        shared += [
            math.log(omega0),
            math.log(known.cell.damping_ratio),
            math.log(known.cell.mass_kg),
        ]
    own = [
        math.log(known.speed_m_per_s),
        math.log(known.restitution),
        known.touch_down_us + shift_us,
        item.window.baseline,
    ]
    model = model_named("hsd" if known.cell is None else "kv")
    return model.predict(np.array([*shared, 0.0, *own]), item.frame).signal


def fit_modulus(
    item: FitShot, known: Known, around_pa: float, *, free_timing: bool = True
) -> ModulusOnly:
    """Return the modulus that fits one shot best in plain least squares.

    It is the best of a grid, then refined. ``around_pa`` is the middle of the search, which reaches
    a factor of 6 either way; ``free_timing`` says whether the touch-down may shift too.
    """
    return fit_pulse(
        item.window.signal,
        lambda modulus_pa, shift_us: predict(item, known, modulus_pa, shift_us),
        around_pa,
        free_timing=free_timing,
    )


def fit_pulse(
    signal: Array,
    predicted: Callable[[float, float], Array],
    around_pa: float,
    *,
    free_timing: bool = True,
) -> ModulusOnly:
    """Return the modulus whose pulse lies best over a signal, in plain least squares.

    ``predicted`` makes a trace [V] from E* [Pa] and a later touch-down [us]; all else is as for
    `fit_modulus`.
    """
    total = float(np.sum((signal - signal.mean()) ** 2))

    def cost(at: Array) -> float:
        """Return the squares left at (ln of the modulus over the middle, shift)."""
        shift = float(at[1]) if free_timing else 0.0
        return float(np.sum((signal - predicted(around_pa * math.exp(at[0]), shift)) ** 2))

    shifts = _SHIFTS_US if free_timing else np.zeros(1)
    grid = [np.array([ln, shift]) for ln in _LN_E_GRID for shift in shifts]
    best = min(grid, key=cost)
    steps = np.array([[0.0, 0.0], [0.08, 0.0], [0.0, 2.0]])
    found = minimize(
        cost,
        best,
        method="Nelder-Mead",
        options={"initial_simplex": best + steps, "xatol": 1e-4, "fatol": 1e-9 * total},
    )
    shift = float(found.x[1]) if free_timing else 0.0
    return ModulusOnly(around_pa * math.exp(found.x[0]), 1 - float(found.fun) / total, shift)


def fit_gain(
    item: FitShot, known: Known, reduced_modulus_pa: float, *, free_timing: bool = True
) -> tuple[float, float]:
    """Return Eq. 7's S and the R² of the best fit, from one shot of a known pair.

    That is how a rigid cell sees it. ``free_timing`` is as for `fit_modulus`.
    """
    y = item.window.signal - item.window.baseline
    total = float(np.sum((y - y.mean()) ** 2))
    best = (math.nan, -math.inf)
    for shift in np.arange(-4.0, 30.0, 0.5) if free_timing else (0.0,):
        force = known.gain_n_per_v * (
            predict(item, known, reduced_modulus_pa, float(shift)) - item.window.baseline
        )
        volts_per_newton = float(force @ y) / float(force @ force)
        r2 = 1 - float(np.sum((y - volts_per_newton * force) ** 2)) / total
        if r2 > best[1]:
            best = (1 / volts_per_newton, r2)
    return best
