"""Anything additive that is locked to the impact.

==============  ====================================================================================
family          what it can take up
==============  ====================================================================================
``locked``      anything additive that comes at a fixed time after touch-down
``template``    the same, sample by sample, in step with the contact; only learned, never asked
``outline``     the same with fewer numbers, for each pair its own
==============  ====================================================================================
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.basis.spline import bumps

Array = NDArray[np.float64]

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
# even knots until so many contact times; each step then so much longer than the one before
TEMPLATE_FINE_UNTIL, TEMPLATE_GROWTH = 3.0, 1.04


def locked_columns(
    samples: int,
    rate: float,
    touch_down_us: float,
    size: float,
    knots_us: Sequence[float] = BUMPS_US,
) -> tuple[list[str], Array]:
    """Return linear splines of the time after touch-down. Labels and shape (n, q)."""
    t = np.arange(samples) / rate * 1e6 - touch_down_us
    before, after = 2 * knots_us[0] - knots_us[1] - 1.0, 2 * knots_us[-1] - knots_us[-2]
    labels = [f"{at:g} us after touch-down" for at in knots_us]
    return labels, bumps(t, np.array([before, *knots_us, after]), size)


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
    """Return linear splines of a time in which every contact lasts equally long.

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
    return labels, bumps(stretched, np.array([before, *knots, after]), size)
