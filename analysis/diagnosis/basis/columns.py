r"""Generic columns: what a residual could look like if something in one slot were wrong.

Each family is a set of signals per shot, computed from the fitted model alone. They are not effects
but upper bounds: the most that anything in their slot could explain, to first order.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``response``    a linear, time-invariant chain: delays, slow decays, resonances of the signal
``static``      a memoryless nonlinearity of the signal, its top above all
``dynamic``     a nonlinearity in the signal's slope
``contact``     a contact force K delta^(3/2) (delta/d)^i (rate/v)^j, on sphere and cell
``loss``        the same on the sphere alone
``cell``        the cell's own four numbers, where they change with surface, shot or time
``speed``       the impact speed that a drop height promises
``locked``      anything additive that comes at a fixed time after touch-down
``template``    the same, sample by sample, in step with the contact; only learned, never asked
``outline``     the same with fewer numbers, for each pair its own
==============  ====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.effects.probe import probe
from analysis.fit.problem import FitShot
from analysis.model.impact_model import SHARED, ImpactModel

Array = NDArray[np.float64]

LAGS_US = (2.0, 4.0, 6.0, 9.0, 13.0, 18.0, 25.0, 35.0, 48.0, 64.0)
DECAYS_S = (0.2e-3, 0.6e-3, 2e-3, 8e-3)
RESONANCES_HZ = (1.5e3, 3e3, 6e3, 10e3, 24e3, 34e3, 50e3, 80e3)
RESONANCE_ZETA = 0.04
TOPS = (0.5, 0.7, 0.82, 0.9, 0.96)
BUMPS_US = (
    0,
    15,
    30,
    45,
    60,
    80,
    100,
    125,
    150,
    190,
    240,
    300,
    380,
    480,
    620,
    800,
    1050,
    1400,
    1900,
)
TEMPLATES = {"template": (24, 120), "outline": (14, 64)}
"""Knots a contact time, and in all."""
TEMPLATE_FINE_UNTIL, TEMPLATE_GROWTH = 3.0, 1.04
CONTACT_POWERS = ((-1.0, 0), (-0.5, 0), (0.5, 0), (1.0, 0), (-1.0, 1), (0.0, 1), (0.5, 1), (0.0, 2))
_SMALL = 2e-3


@dataclass(frozen=True)
class Scale:
    """Sizes common to a campaign, so that a column means the same in every shot.

    Attributes
    ----------
    top : float
        Largest signal of all shots. [unit of the signal]
    indentation_m : float
        Median largest indentation. [m]
    speed_m_per_s : float
        Median impact speed. [m/s]
    pulse_s : float
        Median width of the pulses. [s]
    contact_s : float
        Median contact time by Hertz. [s]
    window_s : float
        Longest window. [s]
    tuned_hz : dict
        Frequency by family, of those that were looked for along the residual. [Hz]
    tuned_zeta : float
        Damping ratio of the one whose damping was looked for as well. [1]
    ripples : float
        Periods of a curve's ripple between zero and the top. [1]
    steepest_per_s : float
        Largest slope of the records. [unit of the signal/s]
    late_impact_us : float
        Width of a late impact after the impact. [us]
    """

    top: float
    indentation_m: float
    speed_m_per_s: float
    pulse_s: float
    contact_s: float
    window_s: float
    tuned_hz: dict[str, float] = field(default_factory=dict)
    tuned_zeta: float = 0.0
    ripples: float = 0.0
    steepest_per_s: float = 0.0
    late_impact_us: float = 0.0


def _delayed(signal: Array, samples: float) -> Array:
    """Return the signal later by a number of samples, at rest before."""
    at = np.arange(signal.size) - samples
    return np.asarray(np.interp(at, np.arange(signal.size), signal, left=0.0))


def response_columns(signal: Array, rate: float) -> tuple[list[str], Array]:
    """Return what a linear, time-invariant chain could add. Labels and shape (n, q)."""
    labels, columns = [], []
    for lag in LAGS_US:
        labels.append(f"lag {lag:g} us")
        columns.append(_delayed(signal, lag * 1e-6 * rate))
    slope = np.gradient(signal) * rate * 1e-6
    labels += ["slope", "curvature"]
    columns += [slope, np.gradient(slope) * rate * 1e-6]
    for tau in DECAYS_S:
        decay = math.exp(-1 / (rate * tau))
        labels.append(f"decay {tau * 1e3:g} ms")
        columns.append(lfilter([1 - decay], [1, -decay], signal))
    for frequency in RESONANCES_HZ:
        if frequency > 0.2 * rate:
            continue
        pole = np.exp((-RESONANCE_ZETA + 1j) * 2 * math.pi * frequency / rate)
        ringing = lfilter([1 - abs(pole)], [1, -pole], signal)
        labels += [f"ring {frequency:g} Hz cos", f"ring {frequency:g} Hz sin"]
        columns += [ringing.real, ringing.imag]
    return labels, np.column_stack(columns)


def static_columns(signal: Array, scale: Scale) -> tuple[list[str], Array]:
    """Return what a memoryless nonlinearity could add. Labels and shape (n, q)."""
    x = signal / scale.top
    labels = ["square", "cube"] + [f"top {t:g}" for t in TOPS]
    columns = [x * x, x**3] + [np.maximum(x - t, 0.0) for t in TOPS]
    return labels, np.column_stack(columns) * scale.top


def dynamic_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return what a nonlinearity in the slope could add. Labels and shape (n, q)."""
    slope = np.gradient(signal) * rate * 2e-5 / scale.top
    x = signal / scale.top
    columns = [slope * np.abs(slope), slope**3, x * slope, np.abs(slope) * x]
    return ["slope |slope|", "slope^3", "signal slope", "signal |slope|"], (
        np.column_stack(columns) * scale.top
    )


def _linear_spline(t: Array, knots: Array, size: float) -> Array:
    """Return piecewise linear bumps over knots, the outer two of which only end the last bumps."""
    at = np.searchsorted(knots, t, side="right") - 1
    inside = (at >= 0) & (at < knots.size - 1)
    rows, left = np.flatnonzero(inside), at[inside]
    share = (t[inside] - knots[left]) / (knots[left + 1] - knots[left])
    whole = np.zeros((t.size, knots.size))
    whole[rows, left] = size * (1.0 - share)
    whole[rows, left + 1] = size * share
    return whole[:, 1:-1]


def locked_columns(
    samples: int,
    rate: float,
    touch_down_us: float,
    size: float,
    knots_us: Sequence[float] = BUMPS_US,
) -> tuple[list[str], Array]:
    """Return hat functions of the time after touch-down. Labels and shape (n, q)."""
    t = np.arange(samples) / rate * 1e6 - touch_down_us
    before, after = 2 * knots_us[0] - knots_us[1] - 1.0, 2 * knots_us[-1] - knots_us[-2]
    labels = [f"{at:g} us after touch-down" for at in knots_us]
    return labels, _linear_spline(t, np.array([before, *knots_us, after]), size)


def template_knots(pulse_us: float, rate: float, *, fineness: int, count: int) -> tuple[float, ...]:
    """Return knots that follow a pulse closely, then the ring more and more coarsely.

    Parameters
    ----------
    pulse_us : float
        Usual contact time. [us]
    rate : float
        Samples per second. [Hz]
    fineness, count : int
        Knots a contact time, and in all.

    Returns
    -------
    tuple of float
        After touch-down. [us]
    """
    step = max(1e6 / rate, pulse_us / fineness)
    knots, at = [0.0], 0.0
    while len(knots) < count:
        if at > TEMPLATE_FINE_UNTIL * pulse_us:
            step *= TEMPLATE_GROWTH
        at += step
        knots.append(at)
    return tuple(knots)


def template_columns(
    samples: int,
    rate: float,
    touch_down_us: float,
    size: float,
    *,
    family: str,
    contact_us: float,
    usual_us: float,
) -> tuple[list[str], Array]:
    """Return hat functions of a time in which every contact lasts equally long.

    Parameters
    ----------
    samples : int
        Of the shot.
    rate : float
        Samples per second. [Hz]
    touch_down_us : float
        Of the shot. [us]
    size : float
        Of the shot. [unit of the signal]
    family : str
        ``template``, or ``outline`` with fewer knots.
    contact_us : float
        Of the shot: within the contact time is stretched to the usual one, beyond it only moved.
        [us]
    usual_us : float
        Contact time of the campaign. [us]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (samples, q)
        [unit of the signal]
    """
    fineness, count = TEMPLATES[family]
    knots = template_knots(usual_us, rate, fineness=fineness, count=count)
    t = np.arange(samples) / rate * 1e6 - touch_down_us
    stretched = np.where(t < contact_us, t * usual_us / contact_us, t - contact_us + usual_us)
    before, after = -knots[1], 2 * knots[-1] - knots[-2]
    labels = [f"{at:.4g} us after touch-down" for at in knots]
    return labels, _linear_spline(stretched, np.array([before, *knots, after]), size)


def contact_labels(*, sphere_only: bool) -> list[str]:
    """Return the labels of the contact family."""
    where = "sphere" if sphere_only else "both"
    return [f"delta^{i:g} rate^{j} on {where}" for i, j in CONTACT_POWERS]


def contact_columns(
    model: ImpactModel, local: Array, item: FitShot, scale: Scale, *, sphere_only: bool
) -> tuple[Array, Array]:
    """Return signal and rebound per unit of each contact power, by a small forward difference.

    Parameters
    ----------
    model : ImpactModel
        The fitted model.
    local : ndarray, shape (p,)
        The shot's fitted local parameters.
    item : FitShot
        The shot.
    scale : Scale
        Common sizes.
    sphere_only : bool
        Whether the force spares the cell.

    Returns
    -------
    signal : ndarray, shape (n, q)
        Per unit coefficient.
    rebound : ndarray, shape (q,)
        Per unit coefficient.
    """
    steps = model.steps(local, item.frame)
    start = model.with_effect(probe(0.0, 0.0, 0, sphere_only=sphere_only))
    base = start.predict(local, item.frame, steps=steps)
    columns, rebounds = [], []
    for i, j in CONTACT_POWERS:
        size = scale.indentation_m ** (-i) * scale.speed_m_per_s ** (-j)
        moved = model.with_effect(probe(_SMALL * size, i, j, sphere_only=sphere_only))
        found = moved.predict(local, item.frame, steps=steps)
        columns.append((found.signal - base.signal) / _SMALL)
        rebounds.append((found.rebound_ratio - base.rebound_ratio) / _SMALL)
    return np.column_stack(columns), np.array(rebounds)


def cell_names(model: ImpactModel) -> list[str]:
    """Return the cell's parameters among a model's shared ones."""
    return [n for n in SHARED[model.kind] if n != "ln_K"]
