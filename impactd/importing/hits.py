"""The hits in a long record, and the samples that belong to each.

A hit is what rises above the quiet noise. How long a window it needs follows from how long the
contact lasts, so that the same rule serves a foam pad at 1 kHz and a ball on glass at 10 MHz.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

FALSE_HITS = 1e-3
"""Hits that noise alone makes in a whole record; the threshold follows from it and the length."""
LEAST_SHARE = 0.05
"""Of the largest excursion: hits of one series seldom differ by more than ten times, and ringing,
handling and crosstalk lie below a twentieth. It is also where a contact is said to begin."""
_FOOT = 0.1
"""Of its peak: where the width of a contact is taken; there a half-sine has 94 % of its length."""
BEFORE_CONTACTS = 10
"""Contacts of quiet signal before a hit: what the noise and the baseline are taken from."""
AFTER_CONTACTS = 30
"""Contacts behind the touch: the cell rings out, and a droop shows."""
_LEAST_BEFORE, _LEAST_AFTER = 64, 256
"""Samples. A standard deviation from 64 is known to 9 %; 256 hold what a contact of eight needs."""
LEAST_QUIET = 8
"""Samples before a hit: from fewer no baseline can be told, and the record began in the hit."""
_PAUSE_CONTACTS = 2
"""Contacts between two impacts, at least: the swings of a ring follow one another faster."""
_BLOW_SHARE = 0.2
"""Of the largest: what bounces comes back with more of its speed, what beats with less."""
_MANY_BLOCKS, _BLOCK = 64, 32
"""A record's blocks, and the least samples of one: the spread of fewer is told too small."""
_QUIET_SHARE = 0.25
"""The quietest quarter of a record is taken to be without hits."""


@dataclass(frozen=True)
class Hit:
    """One hit, or several too close to be parted; places are samples of the record."""

    first: int
    stop: int
    """Excluded."""
    touch: int
    """At which the contact begins."""
    peak: float
    """Largest excursion from the baseline, with its sign."""
    contact: int
    """Width of the first swing at a tenth of its height. [samples]"""
    impacts: int
    """1, or as many as are kept together."""


@dataclass(frozen=True)
class Found:
    """The hits of one record, and the levels they were found with."""

    hits: tuple[Hit, ...]
    """In order of time."""
    noise: float
    """Standard deviation of the quiet part, from its median absolute deviation."""
    threshold: float
    """Excursion from the baseline that counts."""
    begun: int
    """Hits that are left out because the record begins in them."""
    largest: float
    """Largest excursion of the record."""


def find_hits(
    record: NDArray[np.float64], *, step: float | None = None, threshold: float | None = None
) -> Found:
    """Return the hits of a record, with windows that do not overlap.

    Parameters
    ----------
    record : ndarray, shape (n,)
        In any unit; finite.
    step : float, optional
        Of the converter, in the unit of ``record``.
    threshold : float, optional
        Excursion that counts as a hit, instead of the one that follows from the noise.
    """
    zero, noise = quiet_level(record, step)
    away = np.abs(record - zero)
    largest = float(away.max())
    audible = float(norm.isf(FALSE_HITS / (2 * record.size))) * noise
    if threshold is None:
        threshold = max(audible, LEAST_SHARE * largest)
    above = np.flatnonzero(away > threshold)
    if not above.size:
        return Found((), noise, threshold, 0, largest)
    contact = _contact(record - zero, int(np.argmax(away)))
    before = max(_LEAST_BEFORE, BEFORE_CONTACTS * contact)
    after = max(_LEAST_AFTER, AFTER_CONTACTS * contact)
    # A hit has a record of its own where the signal was quiet before it; what comes sooner stays
    # with the hit before, whether it rings or is a second impact.
    groups = np.split(above, np.flatnonzero(np.diff(above) > before) + 1)
    hits, begun = [], 0
    for place, group in enumerate(groups):
        if group[0] < LEAST_QUIET:
            begun += 1
            continue
        first = max(0, int(group[0]) - before)
        stop = min(record.size, max(int(group[0]) + after, int(group[-1]) + before))
        if place + 1 < len(groups):
            stop = min(stop, int(groups[place + 1][0]) - before // 2)
        if place:
            first = max(first, int(groups[place - 1][-1]) + 1)
        hits.append(_hit(record, group, first, stop, audible))
    if len(groups) == 1 and hits and record.size <= 2 * (before + after):
        hits = [_hit(record, groups[0], 0, record.size, audible)]  # was triggered: keep all of it
    return Found(tuple(hits), noise, threshold, begun, largest)


def quiet_level(record: NDArray[np.float64], step: float | None) -> tuple[float, float]:
    """Return baseline and noise of the quiet part of a record, shape (n,), in its unit.

    They are the median, and the standard deviation from the median absolute deviation.
    """
    length = max(_BLOCK, record.size // _MANY_BLOCKS)
    count = max(1, record.size // length)
    blocks = record[: count * length].reshape(count, -1) if record.size >= length else record[None]
    middle = np.median(blocks, axis=1)
    spread = np.median(np.abs(blocks - middle[:, None]), axis=1)
    # The quietest quarter tells how quiet it is; all blocks about as quiet are then pooled, for the
    # quietest by chance would make the noise too small.
    quiet = spread <= 2 * np.quantile(spread, _QUIET_SHARE)
    off = np.abs(blocks[quiet] - middle[quiet, None])
    noise = float(np.median(off)) * 1.4826
    least = step if step is not None else 0.0
    return float(np.median(middle[quiet])), max(noise, least)


def _contact(signal: NDArray[np.float64], at: int) -> int:
    """Return how many samples the swing around a peak is wide."""
    pushed = np.sign(signal[at]) * signal > _FOOT * abs(float(signal[at]))
    behind, ahead = np.flatnonzero(~pushed[: at + 1]), np.flatnonzero(~pushed[at:])
    first = int(behind[-1]) + 1 if behind.size else 0
    stop = at + int(ahead[0]) if ahead.size else signal.size
    return max(1, stop - first)


def _hit(
    record: NDArray[np.float64],
    group: NDArray[np.intp],
    first: int,
    stop: int,
    audible: float,
) -> Hit:
    """Return a hit with the baseline of its own quiet beginning: baselines drift."""
    own = record[first:stop] - float(np.median(record[first : int(group[0])]))
    away = np.abs(own)
    at = int(np.argmax(away))
    level = max(audible, LEAST_SHARE * float(away[at]))
    over = np.flatnonzero(away > level)
    start = int(over[0]) if over.size else int(group[0]) - first
    swing = _first_swing(own, start, at)
    contact = _contact(own, swing)
    pushed = np.flatnonzero(np.sign(own[swing]) * own > max(audible, _BLOW_SHARE * away[at]))
    impacts = 1 + int(np.count_nonzero(np.diff(pushed) > _PAUSE_CONTACTS * contact))
    return Hit(first, stop, first + max(0, start - 1), float(own[at]), contact, impacts)


def _first_swing(own: NDArray[np.float64], start: int, at: int) -> int:
    """Return the peak of the swing that begins at ``start``, no later than the largest."""
    sign = np.sign(own[start])
    turns = np.flatnonzero(sign * own[start:] <= 0.0)
    stop = start + int(turns[0]) if turns.size else own.size
    return min(start + int(np.argmax(sign * own[start : max(stop, start + 1)])), max(at, start))
