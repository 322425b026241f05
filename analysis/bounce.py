r"""Restitution from the bounce: the flight time to the second landing gives the rebound speed.

.. math:: v_r = g T / 2, \quad \epsilon_r = v_r / v_0

T runs from lift-off to the next touch-down. The cell delays both landings alike, so only the
contact's own duration has to be taken off the time between two onsets.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Quantity
from analysis.errors import ParameterOutOfRangeError

BLOCK_S = 64e-6
"""The record is looked at in blocks about as long as a period of the crystal."""
QUIET_BEFORE_S = 1e-3
"""An onset stands out from so much record before it; rings are falling by then."""
STEP_UP = 3.0
"""An onset is so many times larger than what was there before it."""
SHORTEST_FLIGHT_S = 2e-3
SMALLEST_SHARE = 0.01
"""Of the first impact's height; v^1.2 makes this a rebound at 2 % of the impact speed."""
LARGEST_RATIO = 1.05
"""A ratio above this is no rebound: a landing was missed or the impact speed is wrong."""
AIR_RELATIVE_U = 5e-4
"""Buoyancy and drag on a polymer sphere of some millimetres at 1 m/s, neither corrected."""
TRIGGERED_S = 5e-3
"""A trigger that the impact set off comes at most so long before its largest swing. Derived: half a
period of a structure that rings at 100 Hz."""
SHORTEST_CONTACT_S = 12e-6
"""Derived: a steel sphere of 2 mm radius stays so long on steel at 2 m/s (Hertz); what is shorter
is a spike."""
CONTACT_RELATIVE_U = 0.3
"""How well the pulse's width at 5 % stands for the contact's duration behind a ringing crystal."""

_EDGE = 0.05


@dataclass(frozen=True)
class Landing:
    """One impact of a bouncing sphere."""

    onset_index: int
    """First sample of the pulse above 5 % of its height."""
    height: float
    """Largest excursion from the level before it. [unit of the signal]"""
    width_samples: int
    """Samples from onset until the pulse is below 5 % again."""


def _block_ranges(signal: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Return largest minus smallest sample of each whole block; hum does not move within one."""
    whole = signal[: signal.size // block * block].reshape(-1, block)
    return np.asarray(whole.max(axis=1) - whole.min(axis=1))


def _blocks(rate: float) -> tuple[int, int]:
    """Return the samples of a block, and how many blocks an onset stands out from."""
    block = max(8, round(BLOCK_S * rate))
    return block, max(3, round(QUIET_BEFORE_S * rate / block))


def _candidates(
    ranges: NDArray[np.float64], before: int, floor: float, *, first: int = 0
) -> list[int]:
    """Return blocks that rise above the floor and above what was there just before.

    From the block ``first`` on.
    """
    found = []
    for i in first + np.flatnonzero(ranges[first:] > floor):
        # the block before the loud one may hold the pulse's foot, so it does not count
        earlier = ranges[max(0, i - before) : max(0, i - 1)]
        if earlier.size and ranges[i] < STEP_UP * float(earlier.max()):
            continue
        found.append(int(i))
    return found


def _landing(
    signal: NDArray[np.float64], start: int, stop: int, rate: float, polarity: int
) -> Landing | None:
    """Return the pulse whose onset lies in [start, stop), None for a spike of one sample."""
    quiet = signal[max(0, start - round(QUIET_BEFORE_S * rate)) : max(start, 1)]
    level = float(np.median(quiet))
    near = polarity * (signal[start:stop] - level)
    peak = int(np.argmax(near))
    height = float(near[peak])
    if height <= 0 or np.count_nonzero(near > 0.5 * height) < 2:
        return None
    noise = float(np.std(quiet)) if quiet.size > 1 else 0.0
    edge = max(_EDGE * height, min(3.0 * noise, 0.5 * height))
    onset, end = peak, peak
    while onset > 0 and near[onset - 1] > edge:
        onset -= 1
    while end + 1 < near.size and near[end + 1] > edge:
        end += 1
    return Landing(start + onset, height, end - onset + 1)


def _landing_at(
    signal: NDArray[np.float64], i: int, block: int, rate: float, polarity: int
) -> Landing | None:
    """Return the pulse that begins in or around a block, as `_landing` does."""
    start, stop = max(0, (i - 1) * block), min(signal.size, (i + 3) * block)
    return _landing(signal, start, stop, rate, polarity)


def _first_polarity(signal: NDArray[np.float64], trigger: int, reach: int) -> int:
    level = float(np.median(signal[max(0, trigger - 20 * reach) : max(1, trigger - reach)]))
    near = signal[max(0, trigger - reach) : trigger + 8 * reach] - level
    return 1 if near.max() >= -near.min() else -1


def landings(
    signal: NDArray[np.float64], sample_rate_hz: float, trigger_index: int
) -> tuple[Landing, ...]:
    """Return all impacts of a record in order of time, the triggering one first.

    The record may have any unit and either polarity; ``trigger_index`` is a sample near the first
    touch. Empty when nothing happens at the trigger.

    Source: own. An impact is a block whose range exceeds twice the quiet blocks' and three times
    that of the millisecond before it, so a falling ring, hum and drift are none. Validation:
    synthetic records with ring, hum, 1/f noise and spikes in ``tests/analysis/test_bounce.py``.
    """
    block, before = _blocks(sample_rate_hz)
    if signal.size < 2 * block or not 0 <= trigger_index < signal.size:
        return ()
    polarity = _first_polarity(signal, trigger_index, block)
    first = _landing(
        signal,
        max(0, trigger_index - 2 * block),
        min(signal.size, trigger_index + 8 * block),
        sample_rate_hz,
        polarity,
    )
    if first is None:
        return ()
    ranges = _block_ranges(signal, block)
    # nine tenths of a record are quiet; a ring of two milliseconds follows each landing
    floor = max(1.8 * float(np.quantile(ranges, 0.8)), SMALLEST_SHARE * first.height)
    found = [first]
    shortest = SHORTEST_FLIGHT_S * sample_rate_hz
    for i in _candidates(ranges, before, floor):
        if max(0, (i - 1) * block) - found[-1].onset_index < shortest:
            continue
        landing = _landing_at(signal, i, block, sample_rate_hz, polarity)
        if landing is not None and landing.height >= SMALLEST_SHARE * first.height:
            found.append(landing)
    return tuple(found)


def first_impact(signal: NDArray[np.float64], sample_rate_hz: float, trigger_index: int) -> int:
    """Return the onset of the impact where something else set off the trigger earlier.

    Where nothing near the trigger is an onset, drift or a spike set it off. A sphere's first impact
    is its hardest: it is the hardest onset that comes later. ``trigger_index`` where none stands
    out from all that is near the trigger.
    """
    block, before = _blocks(sample_rate_hz)
    ranges = _block_ranges(signal, block)
    first = max(0, trigger_index // block - 2)
    after = math.ceil((trigger_index + TRIGGERED_S * sample_rate_hz) / block) + 1
    near = ranges[first:after]
    if not near.size:
        return trigger_index

    def contact(i: int) -> Landing | None:
        """Return the pulse that begins at a block, None for a spike."""
        polarity = _first_polarity(signal, i * block, block)
        found = _landing_at(signal, i, block, sample_rate_hz, polarity)
        shortest = SHORTEST_CONTACT_S * sample_rate_hz
        return None if found is None or found.width_samples < shortest else found

    if any(contact(i) for i in _candidates(ranges[:after], before, 0.0, first=first)):
        return trigger_index
    harder = _candidates(ranges, before, STEP_UP * float(near.max()), first=after)
    later = [one for i in harder if (one := contact(i))]
    return max(later, key=lambda one: one.height).onset_index if later else trigger_index


def bounce_indices(
    signal: NDArray[np.float64], sample_rate_hz: float, trigger_index: int
) -> tuple[int, ...]:
    """Return the onset sample of every impact of a record, the triggering one first.

    Parameters
    ----------
    trigger_index : int
        Sample near the first touch.

    Returns
    -------
    tuple of int
        Usable as trigger indices: each later one is a shot at a lower speed.
    """
    return tuple(x.onset_index for x in landings(signal, sample_rate_hz, trigger_index))


def restitution_from_bounce(
    signal: NDArray[np.float64],
    sample_rate_hz: float,
    trigger_index: int,
    *,
    impact_speed_m_per_s: float,
    gravity_m_per_s2: float,
    impact_speed_u_m_per_s: float = 0.0,
) -> Quantity | None:
    r"""Return the rebound speed over the impact speed from the time to the second landing.

    .. math:: \epsilon_r = g T / (2 v_0)

    Parameters
    ----------
    sample_rate_hz : float
        Calibrated sample rate. [Hz]
    trigger_index : int
        Sample near the first touch.
    impact_speed_m_per_s : float
        Speed at the first touch, > 0. [m/s]
    gravity_m_per_s2 : float
        Local gravity, > 0. [m/s^2]
    impact_speed_u_m_per_s : float
        Standard uncertainty of the speed. [m/s]

    Returns
    -------
    Quantity or None
        Ratio with standard uncertainty: timing, contact duration, air and impact speed. None when
        the record is too short, nothing lands, or what lands cannot be the rebound (it would be
        faster than the impact, or hits much harder than so short a flight allows).

    Notes
    -----
    Source: ballistic flight between two contacts. Validation: ``tests/analysis/test_bounce.py``.
    """
    found = landings(signal, sample_rate_hz, trigger_index)
    if len(found) < 2 or not impact_speed_m_per_s > 0:
        return None
    first, second = found[0], found[1]
    contact_s = first.width_samples / sample_rate_hz
    flight_s = (second.onset_index - first.onset_index) / sample_rate_hz - contact_s
    ratio = gravity_m_per_s2 * flight_s / (2 * impact_speed_m_per_s)
    # peak force goes like v^1.2 for a slow contact and like v for a short one
    by_height = (second.height / first.height) ** (1 / 1.2)
    if not 0 < ratio <= LARGEST_RATIO or by_height > 2.5 * ratio + 0.05:
        return None
    timing_s = math.hypot(CONTACT_RELATIVE_U * contact_s, 1.0 / sample_rate_hz)
    relative = math.hypot(
        timing_s / flight_s, AIR_RELATIVE_U, impact_speed_u_m_per_s / impact_speed_m_per_s
    )
    return Quantity(ratio, ratio * relative)


def restitution_from_rebound_height(
    rebound_height_m: Quantity, drop_height_m: float, *, speed_repeatability: float = 0.0
) -> Quantity:
    r"""Return the rebound speed over the impact speed from how high the sphere came back.

    .. math:: \epsilon_r = \sqrt{h_r / h}

    Both heights are of the sphere's lowest point and > 0. A ParameterOutOfRangeError says that one
    is not, or that the sphere came back higher than it fell from. ``speed_repeatability`` is the
    relative standard deviation of the impact speed. Source: free fall, up and down. Validation:
    ``tests/analysis/test_bounce.py``.
    """
    if not drop_height_m > 0:
        raise ParameterOutOfRangeError("drop_height_m", drop_height_m, "above 0")
    if not 0 < rebound_height_m.value <= LARGEST_RATIO**2 * drop_height_m:
        raise ParameterOutOfRangeError(
            "rebound_height_m", rebound_height_m.value, "above 0 and below the drop height"
        )
    ratio = math.sqrt(rebound_height_m.value / drop_height_m)
    relative = math.hypot(
        rebound_height_m.u / (2 * rebound_height_m.value), speed_repeatability, AIR_RELATIVE_U
    )
    return Quantity(ratio, ratio * relative)
