"""Zero line, gain and time axis that change within a shot.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``baseline``    a zero line that is no constant, as under mains hum
``alternate``   offset, gain and delay of every second sample
``pieces``      a gain that changes within the contact; only learned
``wander``      a time axis that swings
==============  ====================================================================================
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from analysis.diagnosis.basis.scale import Scale
from analysis.diagnosis.basis.spline import linear_spline
from analysis.diagnosis.basis.waveform import locked_columns

Array = NDArray[np.float64]

PIECES = (0.15, 0.5, 0.85, 1.2)
WANDERS_US = (0, 15, 30, 45, 60, 80, 100, 125, 150, 190, 240, 300, 380, 480, 620)
BASELINE_ORDERS = (1, 2, 3)


def alternate_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return what only every second sample has. Labels and shape (n, q)."""
    del rate
    every_second = 1.0 - 2.0 * (np.arange(signal.size) % 2)
    columns = np.column_stack([np.full(signal.size, scale.top), signal, np.gradient(signal)])
    labels = [f"every second sample's {what}" for what in ("offset", "gain", "delay")]
    return labels, 0.1 * every_second[:, None] * columns


def baseline_columns(signal: Array, rate: float, scale: Scale) -> tuple[list[str], Array]:
    """Return polynomials of the time. Labels and shape (n, q)."""
    del rate
    x = np.linspace(-1.0, 1.0, signal.size)
    labels = [f"zero line of order {n}" for n in BASELINE_ORDERS]
    columns = [legendre.legval(x, np.eye(n + 1)[n]) for n in BASELINE_ORDERS]
    return labels, 0.01 * scale.top * np.column_stack(columns)


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
    return labels, 0.1 * signal[:, None] * linear_spline(t, np.array(PIECES))


def wander_columns(signal: Array, rate: float, touch_down_us: float) -> tuple[list[str], Array]:
    """Return the signal's slope in pieces of time after touch-down. Labels and shape (n, q)."""
    slope = np.gradient(signal) * rate * 1e-6
    labels, pieces = locked_columns(signal.size, rate, touch_down_us, 1.0, WANDERS_US)
    return [f"clock at {label}" for label in labels], pieces * slope[:, None]
