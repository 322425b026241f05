"""What is no linear function of the signal or of the force: curves, with a memory and without.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``static``      a memoryless nonlinearity of the signal, its top above all
``curve``       the same, both signs, fine near zero
``fine``        the same in even steps of a hundredth
``path``        the same, another one for the way up and the way down
``ripple``      a periodic curve of the signal, the same in all shots; only learned
``dynamic``     a nonlinearity in the signal's slope
``droop``       a gain that sinks with what the signal has been
``warmth``      a memory of the signal's square and cube; only learned
``slew``        an amplifier's slew rate: no faster than so much; only learned
``seat``        a force on the crystal that is no straight function of its motion
``contact``     a contact force K delta^(3/2) (delta/d)^i (rate/v)^j, on sphere and cell
``loss``        the same on the sphere alone
==============  ====================================================================================

Signals, columns of shape (n, q) and ``top``, the largest signal of a campaign, have the unit of the
records. The limit of ``slew`` is first read off the records, whose steepest stretches have that
slope; then fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import njit
from scipy.optimize import minimize_scalar

from analysis.aliases import Array
from analysis.diagnosis.basis.linear_filter import (
    Crystal,
    Labelled,
    forgetting,
    linear_spline,
    through_crystal,
)
from analysis.effects.probe import NUMBERS, PROBE, PROBE_ID
from analysis.fit.problem import FitShot
from analysis.model.effect_trace import EffectValues
from analysis.model.impact_model import ImpactModel

TOPS = (0.5, 0.7, 0.82, 0.9, 0.96)
CURVE_KNOTS = (-0.2, -0.06, -0.02, -0.006, -0.002, 0.0, 0.002, 0.006, 0.02, 0.06,
               0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # fmt: skip
PATH_KNOTS = (-0.1, -0.03, 0.0, 0.03, 0.1, 0.25, 0.45, 0.7, 1.0)
FINE_KNOTS = tuple((np.arange(-12, 97) / 96).tolist())
RIPPLE = "ripple"
RIPPLES = tuple(np.arange(4.0, 400.0, 0.25).tolist())
"""Periods between zero and the largest signal."""
HARMONICS = 3
"""Of a ripple, which is no pure sine: of a sawtooth they hold 83 % of the power."""
LEVELS = 4096
"""Into so many parts the signal's range is cut where a ripple is looked for: ten for the shortest
of `RIPPLES`, three for its last harmonic."""
DROOPS_S = (2e-4, 1e-3, 5e-3)
WARMTHS_S = (2e-5, 8e-5, 3.2e-4, 1.3e-3, 5e-3)
SLEW = "slew"
STRETCH = 7
"""Samples over which a slope is read off a record: a line through them has 13 % of the noise that
the difference of two has."""
STEP = 1e-3
"""Relative change of the slope's limit for its derivative: next to nothing beside the tenth that a
coefficient of one stands for, far above rounding."""
SLIDING = 0.01
"""Speed, in crystal's frequency times largest compression, below which dry friction goes through
zero smoothly: the sign of a speed at rest is rounding. Chosen by trial."""
CONTACT_POWERS = ((-1.0, 0), (-0.5, 0), (0.5, 0), (1.0, 0), (-1.0, 1), (0.0, 1), (0.5, 1), (0.0, 2))
_SMALL = 2e-3
"""Share of the contact force at which a derivative is taken."""
COARSE = 0.5
"""Share of the solver's steps for that. Measured against eight times the steps, on four shots from
the lowest to the highest: half leaves a column off by 2e-4 of its length at most, 0.3 by 2e-3. The
scheme is of fifth order, and most of its error is the same in both traces."""


def static_columns(signal: Array, top: float) -> Labelled:
    """Return what a memoryless nonlinearity could add."""
    x = signal / top
    labels = ["square", "cube"] + [f"top {t:g}" for t in TOPS]
    columns = [x * x, x**3] + [np.maximum(x - t, 0.0) for t in TOPS]
    return labels, np.column_stack(columns) * top


def curve_columns(signal: Array, top: float, knots: tuple[float, ...]) -> Labelled:
    """Return a memoryless curve over knots, shares of the largest signal."""
    labels = [f"at {k:.4g} of the top" for k in knots]
    return labels, 0.1 * top * linear_spline(signal / top, np.array(knots))


def path_columns(signal: Array, top: float) -> Labelled:
    """Return a curve for the way up and one for the way down."""
    labels, both = curve_columns(signal, top, PATH_KNOTS)
    up = np.gradient(signal) > 0.0
    columns = np.hstack([both * up[:, None], both * ~up[:, None]])
    return [f"{way} {label}" for way in ("up", "down") for label in labels], columns


def ripple_columns(signal: Array, top: float, cycles: float) -> Labelled:
    """Return a curve of so many periods up to the top, as a converter with uneven steps has one."""
    period = top / cycles
    labels = [f"{p} of {period / k:.4g}" for k in range(1, HARMONICS + 1) for p in ("cos", "sin")]
    return labels, 0.01 * top * _waves(2.0 * math.pi / period * signal)


def _waves(angle: Array) -> Array:
    waves = [f(k * angle) for k in range(1, HARMONICS + 1) for f in (np.cos, np.sin)]
    return np.column_stack(waves)


def best_ripple(signals: Sequence[Array], residuals: Sequence[Array], top: float) -> float:
    """Return how many periods of a curve of the signal take up most of the residuals.

    One of `RIPPLES` or near it, between zero and the largest signal of the campaign.
    """
    level, residual = np.concatenate(signals) / top, np.concatenate(residuals)
    first = np.floor(level.min() * LEVELS)
    at = (np.floor(level * LEVELS) - first).astype(np.intp)
    count, load = np.bincount(at), np.bincount(at, residual)
    held = count > 0
    place = (np.flatnonzero(held) + first + 0.5) / LEVELS
    count, load = count[held], load[held]
    mean = load / count
    rest = np.flatnonzero(np.abs(place) < 1.0 / RIPPLES[0])  # where nearly all samples are
    count = count.astype(np.float64)
    count[rest] = np.minimum(count[rest], np.median(count))

    def power(cycles: float) -> float:
        """Return what one period and its harmonics take up beside a smooth curve."""
        columns = _waves(2.0 * math.pi * cycles * place)
        weighted = columns * count[:, None]
        pull = weighted.T @ mean
        return float(pull @ np.linalg.lstsq(weighted.T @ columns, pull, rcond=1e-9)[0])

    found = max(RIPPLES, key=power)
    bounds = (found - 0.25, found + 0.25)
    return float(minimize_scalar(lambda c: -power(c), bounds=bounds, method="bounded").x)


def dynamic_columns(signal: Array, rate: float, top: float) -> Labelled:
    """Return what a nonlinearity in the slope could add."""
    x, slope = signal / top, np.gradient(signal) * rate * 2e-5 / top
    columns = {
        "slope |slope|": slope * np.abs(slope),
        "slope^3": slope**3,
        "signal slope": x * slope,
        "signal |slope|": np.abs(slope) * x,
    }
    return list(columns), np.column_stack(list(columns.values())) * top


def droop_columns(signal: Array, rate: float, top: float) -> Labelled:
    """Return the signal times its own memory."""
    labels = [f"signal times memory {t * 1e3:g} ms" for t in DROOPS_S]
    columns = [
        signal * forgetting(np.abs(signal), rate, t) * t * rate / (50.0 * top) for t in DROOPS_S
    ]
    return labels, np.column_stack(columns)


def warmth_columns(signal: Array, rate: float, top: float) -> Labelled:
    """Return the memory of the signal's square and cube."""
    x = signal / top
    labels = [f"memory of {n}, {t * 1e3:g} ms" for n in ("square", "cube") for t in WARMTHS_S]
    columns = [forgetting(top * x**n, rate, t) for n in (2, 3) for t in WARMTHS_S]
    return labels, np.column_stack(columns)


@njit(cache=True)
def _limited(signal: Array, most: float) -> Array:
    found = np.empty_like(signal)
    level = signal[0]
    for i in range(signal.size):
        level += min(max(signal[i] - level, -most), most)
        found[i] = level
    return found


def steepest(records: Sequence[Array], rates: Sequence[float]) -> float:
    """Return the largest slope in some records. [unit of the signal/s]"""
    place = np.arange(STRETCH) - (STRETCH - 1) / 2.0
    line = place[::-1] / float(place @ place)
    slopes = [
        rate * float(np.max(np.abs(np.convolve(record, line, "valid"))))
        for record, rate in zip(records, rates, strict=True)
    ]
    return max(slopes)


def slope_columns(signal: Array, rate: float, limit_per_s: float) -> Labelled:
    """Return what a limit of the slope changes, and the change with a tenth more of it."""
    most = limit_per_s / rate
    slower = _limited(signal, most)
    faster = _limited(signal, most * (1.0 + STEP))
    labels = [f"slope limited to {limit_per_s:.4g} per s", "a tenth more of it"]
    return labels, np.column_stack([slower - signal, 0.1 * (faster - slower) / STEP])


def mount_columns(signal: Array, rate: float, top: float, crystal: Crystal | None) -> Labelled:
    """Return what a crystal, if any, adds whose spring or damper is not linear, to first order.

    Forces of second and third order in its motion, which the signal is, through its own resonance.
    """
    if crystal is None:
        return [], np.zeros((signal.size, 0))
    x = signal / top
    v = np.gradient(x) * rate / crystal[0]
    slow = v / np.sqrt(np.square(v) + SLIDING**2)
    forces = {
        "x^2": x * x, "x^3": x**3, "|x|": np.abs(x), "v^2": v * v, "x v": x * v,
        "v |v|": v * np.abs(v), "v |x|": v * np.abs(x), "dry": SLIDING * slow,
    }  # fmt: skip
    all_forces = 0.1 * top * np.column_stack(list(forces.values()))
    return [f"crystal force {name}" for name in forces], through_crystal(all_forces, rate, crystal)


def contact_columns(
    model: ImpactModel, local: Array, item: FitShot, sizes: tuple[float, float],
    *, sphere_only: bool,
) -> Labelled:  # fmt: skip
    """Return what each power of indentation and rate adds to one shot, by a small difference.

    ``sizes`` are the indentation [m] and the speed [m/s] that the powers are measured in.
    """
    indentation_m, speed_m_per_s = sizes
    wanted: list[EffectValues] = [{}]
    for i, j in CONTACT_POWERS:
        strength = _SMALL * indentation_m ** (-i) * speed_m_per_s ** (-j)
        numbers = strength, i, float(j), float(sphere_only)
        wanted.append({PROBE_ID: dict(zip(NUMBERS, numbers, strict=True))})
    steps = math.ceil(COARSE * model.steps(local, item.frame))
    found = model.with_effect(PROBE).predict_each(local, item.frame, wanted, steps=steps)
    where = "sphere" if sphere_only else "both"
    labels = [f"delta^{i:g} rate^{j} on {where}" for i, j in CONTACT_POWERS]
    moved = (found[1:] - found[0]).T
    # a fit may end at a shot that hardly touches; there a step that moves the signal by more than
    # the signal itself, or to no number, is not small and its difference no derivative
    small = np.abs(moved).max(axis=0) <= np.abs(found[0]).max()
    return labels, np.where(small, moved / _SMALL, 0.0)
