r"""Columns that tell slots apart: what only one part of an instrument is likely to do.

They are never asked whether there is structure (`columns` is), only where it lives.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``gain``        the cell's gain
``pitch``       the cell's frequency and damping
``stiffness``   the stiffness of the contact
``creep``       memory from tens of microseconds to milliseconds
``slow``        a slow ring that the impact sets off
``curve``       a memoryless curve of the signal, both signs, fine near zero
``fine``        the same in even steps of a hundredth
``path``        the same, another one for the way up and the way down
``impulse``     any linear, time-invariant chain: an impulse response in pieces; only learned
``seat``        a force on the crystal that is no straight function of its motion
``droop``       a gain that sinks with what the signal has been
``warmth``      a memory of the signal's square and cube; only learned
``alternate``   offset, gain and delay of every second sample
``baseline``    a zero line that is no constant, as under mains hum
``pieces``      a gain that changes within the contact; only learned
``wander``      a time axis that swings
==============  ====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.signal import fftconvolve, lfilter

from analysis.diagnosis.basis.columns import Scale, locked_columns
from analysis.model.impact_model import ImpactModel

Array = NDArray[np.float64]
Crystal = tuple[float, float]
"""Angular frequency [rad/s] and damping ratio [1]."""

CREEPS_S = (2e-5, 8e-5, 3.2e-4, 1.3e-3, 5e-3)
SLOW_HZ = (300.0, 600.0, 1200.0, 2400.0)
SLOW_ZETA = 0.1
CURVE_KNOTS = (-0.2, -0.06, -0.02, -0.006, -0.002, 0.0, 0.002, 0.006, 0.02, 0.06,
               0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # fmt: skip
PATH_KNOTS = (-0.1, -0.03, 0.0, 0.03, 0.1, 0.25, 0.45, 0.7, 1.0)
FINE_KNOTS = tuple((np.arange(-12, 97) / 96).tolist())
IMPULSE_STEP_US, IMPULSE_EVEN_US, IMPULSE_GROWTH, IMPULSE_UNTIL_US = 2.0, 20.0, 1.1, 1500.0
IMPULSE_LONGEST_US = 12.0
"""Knots of an impulse response: even ones first, then wider and wider apart, up to the longest."""
DROOPS_S = (2e-4, 1e-3, 5e-3)
PIECES = (0.15, 0.5, 0.85, 1.2)
WANDERS_US = (0, 15, 30, 45, 60, 80, 100, 125, 150, 190, 240, 300, 380, 480, 620)
BASELINE_ORDERS = (1, 2, 3)
SLIDING = 0.01
"""Speed, in crystal's frequency times largest compression, at which dry friction is at its most."""
CHANGE = 0.05
"""Relative change of a parameter that a coefficient of one stands for."""


def forgetting(signal: Array, rate: float, tau_s: float) -> Array:
    """Return the signal's mean over the last so many seconds, exponentially forgotten."""
    decay = math.exp(-1 / (rate * tau_s))
    return np.asarray(lfilter([1 - decay], [1, -decay], signal))


def ringing(signal: Array, rate: float, frequency_hz: float, zeta: float) -> tuple[Array, Array]:
    """Return what a resonance makes of a signal, in phase and out of it."""
    pole = np.exp((-zeta + 1j) * 2 * math.pi * frequency_hz / rate)
    found = lfilter([1 - abs(pole)], [1, -pole], signal)
    return found.real, found.imag


def _linear_spline(values: Array, knots: Array) -> Array:
    """Return piecewise linear functions, one at each knot and flat beyond. Shape (n, knots)."""
    inside = np.clip(values, knots[0], knots[-1])
    at = np.clip(np.searchsorted(knots, inside, side="right") - 1, 0, knots.size - 2)
    share = (inside - knots[at]) / (knots[at + 1] - knots[at])
    found = np.zeros((values.size, knots.size))
    rows = np.arange(values.size)
    found[rows, at] = 1.0 - share
    found[rows, at + 1] = share
    return found


def _creep(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del scale
    labels = [f"memory {t * 1e3:g} ms" for t in CREEPS_S]
    return labels, np.column_stack([forgetting(signal, rate, t) for t in CREEPS_S])


def _slow(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del scale
    labels = [f"slow ring {f:g} Hz {p}" for f in SLOW_HZ for p in ("cos", "sin")]
    return labels, np.column_stack(
        [c for f in SLOW_HZ for c in ringing(signal, rate, f, SLOW_ZETA)]
    )


def _curve(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del rate
    return [f"at {k:g} of the top" for k in CURVE_KNOTS], _bent(signal, scale, CURVE_KNOTS)


def _bent(signal: Array, scale: Scale, knots: tuple[float, ...]) -> Array:
    return 0.1 * scale.top * _linear_spline(signal / scale.top, np.array(knots))


def _fine(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del rate
    return [f"at {k:.4g} of the top" for k in FINE_KNOTS], _bent(signal, scale, FINE_KNOTS)


def _path(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del rate
    both = _bent(signal, scale, PATH_KNOTS)
    up = np.gradient(signal) > 0.0
    labels = [f"{way} at {k:g} of the top" for way in ("up", "down") for k in PATH_KNOTS]
    return labels, np.hstack([both * up[:, None], both * ~up[:, None]])


def _impulse(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del scale
    knots, step = [0.0], IMPULSE_STEP_US
    while knots[-1] < IMPULSE_UNTIL_US:
        if knots[-1] >= IMPULSE_EVEN_US:
            step = min(step * IMPULSE_GROWTH, IMPULSE_LONGEST_US)
        knots.append(knots[-1] + step)
    lags = np.arange(min(signal.size, int(knots[-1] * 1e-6 * rate) + 1)) / rate * 1e6
    pieces = _linear_spline(lags, np.array(knots))[:, :-1]
    pieces /= np.maximum(pieces.sum(axis=0), 1.0)
    found = fftconvolve(signal[:, None], pieces, axes=0)[: signal.size]
    return [f"{k:.4g} us later" for k in knots[:-1]], found


def _droop(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    labels = [f"signal times memory {t * 1e3:g} ms" for t in DROOPS_S]
    columns = [
        signal * forgetting(np.abs(signal), rate, t) * t * rate / (50.0 * scale.top)
        for t in DROOPS_S
    ]
    return labels, np.column_stack(columns)


def _warmth(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    x = signal / scale.top
    labels = [f"memory of {n}, {t * 1e3:g} ms" for n in ("square", "cube") for t in CREEPS_S]
    columns = [forgetting(scale.top * x**n, rate, t) for n in (2, 3) for t in CREEPS_S]
    return labels, np.column_stack(columns)


def _alternate(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del rate
    every_second = 1.0 - 2.0 * (np.arange(signal.size) % 2)
    columns = np.column_stack([np.full(signal.size, scale.top), signal, np.gradient(signal)])
    labels = [f"every second sample's {what}" for what in ("offset", "gain", "delay")]
    return labels, 0.1 * every_second[:, None] * columns


def _baseline(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    del rate
    x = np.linspace(-1.0, 1.0, signal.size)
    labels = [f"zero line of order {n}" for n in BASELINE_ORDERS]
    columns = [legendre.legval(x, np.eye(n + 1)[n]) for n in BASELINE_ORDERS]
    return labels, 0.01 * scale.top * np.column_stack(columns)


def wander_columns(signal: Array, rate: float, touch_down_us: float) -> tuple[list[str], Array]:
    """Return the signal's slope in pieces of time after touch-down. Labels and shape (n, q)."""
    slope = np.gradient(signal) * rate * 1e-6
    labels, pieces = locked_columns(signal.size, rate, touch_down_us, 1.0, WANDERS_US)
    return [f"clock at {label}" for label in labels], pieces * slope[:, None]


def piece_columns(
    signal: Array, rate: float, touch_down_us: float, contact_us: float
) -> tuple[list[str], Array]:
    """Return the signal in pieces: early, middle and late contact, and all that follows.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    rate : float
        Sampling rate. [Hz]
    touch_down_us, contact_us : float
        Of the shot. [us]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 4)
        [unit of the signal]
    """
    t = (np.arange(signal.size) / rate * 1e6 - touch_down_us) / contact_us
    labels = [f"gain at {k:g} contact times" for k in PIECES]
    return labels, 0.1 * signal[:, None] * _linear_spline(t, np.array(PIECES))


OF_SIGNAL: dict[str, Callable[[Array, float, Scale], tuple[list[str], Array]]] = {
    "creep": _creep,
    "slow": _slow,
    "curve": _curve,
    "fine": _fine,
    "path": _path,
    "impulse": _impulse,
    "droop": _droop,
    "warmth": _warmth,
    "alternate": _alternate,
    "baseline": _baseline,
}
"""Families that are functions of the model's signal alone."""

OF_PARAMETERS = {"gain": ("ln_S",), "pitch": ("ln_w", "ln_z"), "stiffness": ("ln_K",)}
"""Families that are changes of the model's own parameters."""


def through_crystal(force: Array, rate: float, crystal: Crystal) -> Array:
    """Return how far a crystal is compressed by a force, a steady force of one by one.

    Parameters
    ----------
    force : ndarray, shape (n,) or (n, q)
        Over time along axis 0. [any]
    rate : float
        Sampling rate. [Hz]
    crystal : tuple
        Angular frequency and damping ratio. [rad/s, 1]

    Returns
    -------
    ndarray, shape (n,) or (n, q)
        A force is felt from the next sample on. [unit of the force]
    """
    angle, zeta = crystal[0] / rate, crystal[1]
    pole = np.exp((-zeta + 1j * math.sqrt(max(1.0 - zeta**2, 0.0))) * angle)
    turn = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    return np.asarray(lfilter([0.0, sum(turn)], turn, force, axis=0))


def mount_columns(
    signal: Array, rate: float, top: float, crystal: Crystal
) -> tuple[list[str], Array]:
    """Return what a crystal adds whose spring or damper is not linear, to first order.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's, which is the crystal's compression. [unit of the signal]
    rate : float
        Sampling rate. [Hz]
    top : float
        Largest signal of the campaign. [unit of the signal]
    crystal : tuple
        Angular frequency and damping ratio. [rad/s, 1]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 8)
        Forces of second and third order in the motion, through the crystal's own resonance.
        [unit of the signal]
    """
    x = signal / top
    v = np.gradient(x) * rate / crystal[0]
    slow = v / np.sqrt(np.square(v) + SLIDING**2)
    forces = {
        "x^2": x * x, "x^3": x**3, "|x|": np.abs(x), "v^2": v * v, "x v": x * v,
        "v |v|": v * np.abs(v), "v |x|": v * np.abs(x), "dry": SLIDING * slow,
    }  # fmt: skip
    all_forces = 0.1 * top * np.column_stack(list(forces.values()))
    return [f"crystal force {name}" for name in forces], through_crystal(all_forces, rate, crystal)


def parameter_columns(family: str, model: ImpactModel, jacobian: Array) -> tuple[list[str], Array]:
    """Return a change of the model's own parameters as columns. Labels and shape (n, q)."""
    names = [n for n in OF_PARAMETERS[family] if n in model.shared]
    return names, CHANGE * jacobian[:, [model.shared.index(n) for n in names]]
