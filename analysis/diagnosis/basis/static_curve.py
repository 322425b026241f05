"""Curves of the signal without a memory.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``static``      a memoryless nonlinearity of the signal, its top above all
``curve``       the same, both signs, fine near zero
``fine``        the same in even steps of a hundredth
``path``        the same, another one for the way up and the way down
``ripple``      a periodic curve of the signal, the same in all shots; only learned
==============  ====================================================================================
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.spline import linear_spline

Array = NDArray[np.float64]

TOPS = (0.5, 0.7, 0.82, 0.9, 0.96)
CURVE_KNOTS = (-0.2, -0.06, -0.02, -0.006, -0.002, 0.0, 0.002, 0.006, 0.02, 0.06,
               0.12, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)  # fmt: skip
PATH_KNOTS = (-0.1, -0.03, 0.0, 0.03, 0.1, 0.25, 0.45, 0.7, 1.0)
FINE_KNOTS = tuple((np.arange(-12, 97) / 96).tolist())
RIPPLE = "ripple"
RIPPLES = tuple(np.arange(4.0, 400.0, 0.25).tolist())
"""Periods between zero and the largest signal."""
HARMONICS = 3
"""Of a ripple, which is no pure sine."""
LEVELS = 4096
"""Into so many parts the signal's range is cut where a ripple is looked for."""


def static_columns(signal: Array, scale: Scale) -> tuple[list[str], Array]:
    """Return what a memoryless nonlinearity could add. Labels and shape (n, q)."""
    x = signal / scale.top
    labels = ["square", "cube"] + [f"top {t:g}" for t in TOPS]
    columns = [x * x, x**3] + [np.maximum(x - t, 0.0) for t in TOPS]
    return labels, np.column_stack(columns) * scale.top


def curve_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return a memoryless curve, fine near zero. Labels and shape (n, q)."""
    del rate
    return [f"at {k:g} of the top" for k in CURVE_KNOTS], _bent(signal, scale, CURVE_KNOTS)


def _bent(signal: Array, scale: Scale, knots: tuple[float, ...]) -> Array:
    return 0.1 * scale.top * linear_spline(signal / scale.top, np.array(knots))


def fine_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return a memoryless curve in even steps. Labels and shape (n, q)."""
    del rate
    return [f"at {k:.4g} of the top" for k in FINE_KNOTS], _bent(signal, scale, FINE_KNOTS)


def path_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return a curve for the way up and one for the way down. Labels and shape (n, q)."""
    del rate
    both = _bent(signal, scale, PATH_KNOTS)
    up = np.gradient(signal) > 0.0
    labels = [f"{way} at {k:g} of the top" for way in ("up", "down") for k in PATH_KNOTS]
    return labels, np.hstack([both * up[:, None], both * ~up[:, None]])


def ripple_columns(signal: Array, top: float, cycles: float) -> tuple[list[str], Array]:
    """Return a periodic curve of the signal, as a converter with uneven steps has one.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        The model's. [unit of the signal]
    top : float
        Largest signal of the campaign. [unit of the signal]
    cycles : float
        Periods between zero and the top. [1]

    Returns
    -------
    labels : list of str
        One a column.
    columns : ndarray, shape (n, 2 HARMONICS)
        [unit of the signal]
    """
    period = top / cycles
    angle = 2.0 * math.pi / period * signal
    labels = [f"{p} of {period / k:.4g}" for k in range(1, HARMONICS + 1) for p in ("cos", "sin")]
    columns = [f(k * angle) for k in range(1, HARMONICS + 1) for f in (np.cos, np.sin)]
    return labels, 0.01 * top * np.column_stack(columns)


def best_ripple(signals: Sequence[Array], residuals: Sequence[Array], top: float) -> float:
    """Return how many periods of a curve of the signal take up most of the residuals.

    Parameters
    ----------
    signals, residuals : sequence of ndarray, shape (n_i,)
        The model's signal and what it leaves. [unit of the signal]
    top : float
        Largest signal of the campaign. [unit of the signal]

    Returns
    -------
    float
        Between zero and the top; one of `RIPPLES` or near it. [1]
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
        angle = 2.0 * math.pi * cycles * place
        waves = [f(k * angle) for k in range(1, HARMONICS + 1) for f in (np.cos, np.sin)]
        columns = np.column_stack(waves)
        weighted = columns * count[:, None]
        pull = weighted.T @ mean
        return float(pull @ np.linalg.lstsq(weighted.T @ columns, pull, rcond=1e-9)[0])

    found = max(RIPPLES, key=power)
    near = minimize_scalar(
        lambda c: -power(c), bounds=(found - 0.25, found + 0.25), method="bounded"
    )
    return float(near.x)
