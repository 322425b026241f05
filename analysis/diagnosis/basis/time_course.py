"""Basis columns at a fixed time after touch-down, at one time, or along the shot.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``locked``      anything additive that comes at a fixed time after touch-down
``outline``     the same in step with the contact, for each pair its own; only learned
``jump``        a time axis that jumps, as where a transfer loses samples; only learned
``blow``        a late impact: a second bell of force, read through the crystal; only learned
``baseline``    a baseline that is not constant, as under mains hum
``alternate``   offset, gain and delay of every second sample
``pieces``      a gain that changes within the contact; only learned
``wander``      a time axis that swings
==============  ====================================================================================

When a jump or a late impact comes is looked for along the shot's own residual; how far or how large
it is, is then fitted. Signals and columns of shape (n, q) have the unit of the records.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial import legendre
from scipy.signal import correlate

from analysis.aliases import Array
from analysis.diagnosis.basis.linear_filter import (
    Crystal,
    Labelled,
    linear_spline,
    through_crystal,
)

BUMPS_US = (0, 15, 30, 45, 60, 80, 100, 125, 150, 190, 240, 300, 380, 480, 620,
            800, 1050, 1400, 1900)  # fmt: skip
WANDERS_US = BUMPS_US[:15]
OUTLINE_FINENESS, OUTLINE_KNOTS = 14, 64
"""Knots a contact time, and in all."""
# even knots until so many contact times; each step then so much longer than the one before
OUTLINE_FINE_UNTIL, OUTLINE_GROWTH = 3.0, 1.04
_LATER = np.array([*np.arange(0.25, 2.0, 0.25), *range(2, 13)])
SHIFTS = np.concatenate((-_LATER[::-1], [0.0], _LATER))
"""Samples by which the record may be late or early, on either side of a jump."""
LATE_IMPACT = "blow"
WIDTHS_US = tuple((12.0 * 2.0 ** np.arange(0.0, 6.5, 0.125)).tolist())
RING_US = 600.0
"""How long after its own end a late impact is felt. Derived: a cell of 17 kHz with a damping ratio
of 0.07 has then rung 4.6 decay times of 130 us, and 1 % is left."""
EARLY_US = 1.0
"""A unit: a coefficient of one moves a late impact of size one by a sample at 1 MHz."""
BASELINE_ORDERS = (1, 2, 3)
PIECES = (0.15, 0.5, 0.85, 1.2)
"""Early, middle and late contact, and all that follows. [contact times]"""


def locked_columns(
    samples: int, rate: float, touch_down_us: float, size: float, knots_us: Sequence[float]
) -> Labelled:
    """Return linear splines of the time after touch-down, of so large a signal."""
    t = np.arange(samples) / rate * 1e6 - touch_down_us
    before, after = 2 * knots_us[0] - knots_us[1] - 1.0, 2 * knots_us[-1] - knots_us[-2]
    labels = [f"{at:g} us after touch-down" for at in knots_us]
    return labels, _bumps(t, np.array([before, *knots_us, after]), size)


def _bumps(t: Array, knots: Array, size: float) -> Array:
    """Return piecewise linear bumps over knots, the outer two of which only end the last bumps."""
    return size * linear_spline(t, knots)[:, 1:-1]


def outline_columns(
    times: tuple[int, float, float], size: float, contact_us: float, usual_us: float
) -> Labelled:
    """Return linear splines of a time in which every contact lasts equally long.

    ``times`` are samples, rate and touch-down [us]. Within a shot's contact, time is stretched to
    the usual contact, beyond it only moved. Knots follow the pulse closely, then the ring more and
    more coarsely.
    """
    samples, rate, touch_down_us = times
    step = max(1e6 / rate, usual_us / OUTLINE_FINENESS)
    knots = [0.0]
    while len(knots) < OUTLINE_KNOTS:
        if knots[-1] > OUTLINE_FINE_UNTIL * usual_us:
            step *= OUTLINE_GROWTH
        knots.append(knots[-1] + step)
    t = np.arange(samples) / rate * 1e6 - touch_down_us
    stretched = np.where(t < contact_us, t * usual_us / contact_us, t - contact_us + usual_us)
    before, after = -knots[1], 2 * knots[-1] - knots[-2]
    labels = [f"{at:.4g} us after touch-down" for at in knots]
    return labels, _bumps(stretched, np.array([before, *knots, after]), size)


def jump_columns(signal: Array, residual: Array, first: int) -> Labelled:
    """Return what a shot's best jump adds, for one sample of it, not before the sample ``first``.

    The coefficient says how far the clock jumps, whichever jump was the best so far.
    """
    places, whole = np.arange(signal.size), np.floor(SHIFTS).astype(np.intp)
    most = int(np.abs(whole).max()) + 1
    later = sliding_window_view(np.pad(signal, most, mode="edge"), signal.size)
    near = later[most + whole]
    shifted = near + (SHIFTS - whole)[:, None] * (later[most + whole + 1] - near)
    added = shifted - signal
    fall = added * (2.0 * residual - added)
    until = np.cumsum(fall, axis=1) - fall
    since = fall.sum(axis=1, keepdims=True) - until
    before, after = until.argmax(axis=0), since.argmax(axis=0)
    both = until[before, places] + since[after, places]
    at = first + int(np.argmax(both[first:]))
    lost = float(SHIFTS[after[at]] - SHIFTS[before[at]])
    if lost == 0.0:
        return ["samples lost"], np.zeros((signal.size, 1))
    column = (shifted[after[at]] - shifted[before[at]]) * (places >= at) * (1.0 / lost)
    return ["samples lost"], column[:, None]


def late_impact_shape(width_us: float, rate: float, crystal: Crystal | None) -> Array:
    """Return what the cell, rigid where it has no crystal, reads of a bell of force as high as 1.

    From the sample at which it begins.
    """
    long = max(int(width_us * 1e-6 * rate), 3)
    force = np.zeros(long + int(RING_US * 1e-6 * rate))
    force[:long] = 0.5 - 0.5 * np.cos(2.0 * math.pi * (np.arange(long) + 0.5) / long)
    return force if crystal is None else through_crystal(force, rate, crystal)


def _place(residual: Array, shape: Array, first: int) -> tuple[int, float]:
    """Return the place at which a shape explains most of a residual, and how much."""
    room = residual.size - first
    if room < 2:
        return first, 0.0
    heard = correlate(np.append(residual[first:], np.zeros(shape.size)), shape, "valid")[:room]
    power = np.cumsum(np.square(shape))
    seen = power[np.minimum(room - np.arange(room), shape.size) - 1]
    # what is cut off by the end of the record is no late impact yet
    fall = np.where(seen > 0.5 * power[-1], np.square(heard) / np.maximum(seen, 1e-300), 0.0)
    at = int(np.argmax(fall))
    return first + at, float(fall[at])


def late_impact_width(
    residuals: Sequence[Array], firsts: Sequence[int], rates: Sequence[float],
    crystals: Sequence[Crystal | None],
) -> float:  # fmt: skip
    """Return the width at which one late impact a shot explains most of the residuals. [us]

    None begins before the samples ``firsts``. Noise is taken as white here: it only chooses.
    """
    readers = list(zip(rates, crystals, strict=True))
    falls = []
    for width in WIDTHS_US:
        shapes = {reader: late_impact_shape(width, *reader) for reader in set(readers)}
        places = zip(residuals, firsts, readers, strict=True)
        falls.append(sum(_place(r, shapes[reader], first)[1] for r, first, reader in places))
    return float(WIDTHS_US[int(np.argmax(falls))])


def late_impact_columns(
    residual: Array, first: int, rate: float, shape: Array, size: float
) -> Labelled:
    """Return what a shot's best late impact of a size adds, and what it adds when it comes earlier.

    ``shape`` is from `late_impact_shape`; it does not begin before the sample ``first``.
    """
    at, _ = _place(residual, shape, first)
    column = np.zeros(residual.size)
    seen = min(shape.size, residual.size - at)
    column[at : at + seen] = size * shape[:seen]
    earlier = np.gradient(column) * rate * 1e-6 * EARLY_US
    return ["a blow over the pulse", "earlier"], np.column_stack([column, earlier])


def baseline_columns(samples: int, top: float) -> Labelled:
    """Return polynomials of the time, of a hundredth of the largest signal."""
    x = np.linspace(-1.0, 1.0, samples)
    columns = [legendre.legval(x, np.eye(n + 1)[n]) for n in BASELINE_ORDERS]
    labels = [f"zero line of order {n}" for n in BASELINE_ORDERS]
    return labels, 0.01 * top * np.column_stack(columns)


def alternate_columns(signal: Array, top: float) -> Labelled:
    """Return what only every second sample has."""
    every_second = 1.0 - 2.0 * (np.arange(signal.size) % 2)
    columns = np.column_stack([np.full(signal.size, top), signal, np.gradient(signal)])
    labels = [f"every second sample's {what}" for what in ("offset", "gain", "delay")]
    return labels, 0.1 * every_second[:, None] * columns


def piece_columns(signal: Array, rate: float, touch_down_us: float, contact_us: float) -> Labelled:
    """Return the signal in pieces of the contact."""
    t = (np.arange(signal.size) / rate * 1e6 - touch_down_us) / contact_us
    labels = [f"gain at {k:g} contact times" for k in PIECES]
    return labels, 0.1 * signal[:, None] * linear_spline(t, np.array(PIECES))


def wander_columns(signal: Array, rate: float, touch_down_us: float) -> Labelled:
    """Return the signal's slope in pieces of time after touch-down."""
    slope = np.gradient(signal) * rate * 1e-6
    labels, pieces = locked_columns(signal.size, rate, touch_down_us, 1.0, WANDERS_US)
    return [f"clock at {label}" for label in labels], pieces * slope[:, None]
